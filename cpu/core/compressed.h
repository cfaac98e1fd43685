// The compressed tree: half the bytes of a node, three fifths of most blocks', and the same hits bit for bit.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include "core/layout.h"

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

// Up to four triangles over six or eight vertices, each stored once: neighbours share them, and a leaf that does not
// get by with eight takes two blocks. What follows the header: rows x, y, z of the vertices, then a prim a lane, in 96
// or 128 bytes. corners holds the number of each corner's vertex, four bits each, lane by lane: first vertices in the
// low half of word 0, second in its high half, third in the low half of word 1. Above these, word 1 has a bit for each
// lane that is used (the others hold prim -1), and then the number of vertices. One may read eight floats from any row
// on.
struct alignas(32) CompressedBlock {
    static constexpr int few_vertices = 6, most_vertices = 8;

    std::uint32_t corners[2];

    [[gnu::always_inline]] std::uint32_t vertices() const { return corners[1] >> 20; }
    [[gnu::always_inline]] unsigned used() const { return corners[1] >> 16 & 15u; }
    [[gnu::always_inline]] int corner(int k, int lane) const {
        return static_cast<int>(corners[k >> 1] >> (16 * (k & 1) + 4 * lane) & 7u);
    }

    [[gnu::always_inline]] const float* row(std::size_t axis) const {
        return reinterpret_cast<const float*>(this) + 2 + vertices() * axis;
    }
    [[gnu::always_inline]] float vertex(int k, int axis, int lane) const {
        return row(static_cast<std::size_t>(axis))[corner(k, lane)];
    }
    [[gnu::always_inline]] std::int32_t prim_at(int lane) const { return std::bit_cast<std::int32_t>(row(3)[lane]); }

    [[gnu::always_inline]] static constexpr std::size_t units(std::size_t vertices) { return vertices / 2; }
    [[gnu::always_inline]] std::size_t units() const { return units(vertices()); }
    [[gnu::always_inline]] const CompressedBlock* next() const { return this + units(); }
};
static_assert(sizeof(CompressedBlock) == unit_bytes);

// A leaf holds at most so many triangles, because any two fit into one block.
inline constexpr int max_compressed_leaf = 2 * max_leaf_blocks;

}  // namespace wive
