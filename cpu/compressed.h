// The compressed tree: half the bytes of a node, three fifths of a block's, and the same hits bit for bit.
#pragma once

#include <cstddef>
#include <cstdint>

#include "layout.h"

namespace wive {

// An inner node in two cache lines. A plane is origin + step * its byte, rounded outwards from the plane of the
// uncompressed node; the step is a power of two. Rows as there: lo.x hi.x lo.y hi.y lo.z hi.z. Order as there with
// three bits an octant: lane i packs in 24 bits the slot that comes i-th, (order[i] >> 3 * o) & 7. A step may be so
// small against a ray's slack that no box is inverted enough never to be hit: lanes without a child hold
// end_of_stack there, and are taken out of the hits.
struct alignas(64) CompressedNode {
    float origin[3], step[3];
    std::uint8_t planes[6][node_width];
    std::uint8_t order[node_width][3];
    std::uint32_t child[node_width];

    double plane(int row, int lane) const {
        return origin[row / 2] + static_cast<double>(step[row / 2]) * planes[row][lane];
    }
};
static_assert(sizeof(CompressedNode) == 128 && offsetof(CompressedNode, child) == 96);

// Four triangles over at most six vertices, each stored once; neighbours share them, and a leaf that does not get by
// with six takes two blocks. Rows are x, y, z. corners holds the number of each corner's vertex, four bits each, lane by
// lane: first vertices in the low half of word 0, second in its high half, third in the low half of word 1. Bits 16
// to 19 of word 1 say which lanes are used; the others hold prim -1.
inline constexpr int block_vertices = 6;
struct alignas(32) CompressedBlock {
    float rows[3][block_vertices];
    std::int32_t prim[block_width];
    std::uint32_t corners[2];

    unsigned used() const { return corners[1] >> 16; }
    int corner(int k, int lane) const { return static_cast<int>(corners[k >> 1] >> (16 * (k & 1) + 4 * lane) & 7u); }
    float vertex(int k, int axis, int lane) const { return rows[axis][corner(k, lane)]; }
};
static_assert(sizeof(CompressedBlock) == 96);

// A leaf holds at most so many triangles, because any two fit into one block.
inline constexpr int max_compressed_leaf = 2 * max_leaf_blocks;

}  // namespace wive
