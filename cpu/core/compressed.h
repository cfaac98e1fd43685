// The compressed tree: nodes of half the bytes and most blocks of three fifths, with the same hits bit for bit.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

#include "core/layout.h"

namespace wive {

// An inner node in two cache lines. A plane is origin + step * byte, rounded outwards from the plane of the
// uncompressed node; step is a power of two. Rows are those of Node. The order row packs three bits per octant into 24
// bits per lane: lane i holds the slot that comes i-th, (order[i] >> 3 * octant) & 7.
//
// Lanes without a child hold end_of_stack, which takes them out of the hits. Their boxes are inverted, but step may be
// so small compared with a ray's slack that this alone does not make them miss.
struct alignas(64) CompressedNode {
    static constexpr int order_bits = 3, order_bytes = octants * order_bits / 8;
    static constexpr int highest_plane = 255;

    float origin[3], step[3];
    std::uint8_t planes[plane_rows][node_width];
    std::uint8_t order[node_width][order_bytes];
    std::uint32_t child[node_width];

    double plane(int row, int lane) const {
        return origin[row / 2] + static_cast<double>(step[row / 2]) * planes[row][lane];
    }
};
static_assert(sizeof(CompressedNode) == 128 && offsetof(CompressedNode, child) == 96);

// Up to four triangles over six or eight vertices, each stored once: neighbours share them. A leaf whose triangles need
// more than eight vertices takes several blocks. 96 or 128 bytes: two header words, rows x, y and z of the vertices,
// and one prim per lane (-1 in unused lanes).
//
// The header, bit by bit:
//   word 0   0-15   vertex number of corner 0, corner_bits per lane;  16-31  of corner 1
//   word 1   0-15   of corner 2;  16-19  one bit per used lane;  20-31  number of vertices stored
//
// Eight floats are readable from the start of rows x, y and z.
struct alignas(32) CompressedBlock {
    static constexpr int few_vertices = 6, most_vertices = 8;
    static constexpr int corner_bits = 4, corner_row_bits = corner_bits * block_width;
    static constexpr unsigned corner_mask = 7;
    static constexpr int used_shift = 16, vertices_shift = 20;
    static constexpr unsigned used_mask = (1u << block_width) - 1;
    static constexpr std::size_t header_words = 2, prim_row = 3;

    std::uint32_t corners[header_words];

    // Which word holds a vertex number, and where in it.
    [[gnu::always_inline]] static constexpr int corner_word(int k) { return k >> 1; }
    [[gnu::always_inline]] static constexpr int corner_shift(int k, int lane) {
        return corner_row_bits * (k & 1) + corner_bits * lane;
    }

    [[gnu::always_inline]] std::uint32_t vertices() const { return corners[1] >> vertices_shift; }
    [[gnu::always_inline]] unsigned used() const { return corners[1] >> used_shift & used_mask; }
    [[gnu::always_inline]] int corner(int k, int lane) const {
        return static_cast<int>(corners[corner_word(k)] >> corner_shift(k, lane) & corner_mask);
    }

    [[gnu::always_inline]] const float* row(std::size_t axis) const {
        return reinterpret_cast<const float*>(this) + header_words + vertices() * axis;
    }
    [[gnu::always_inline]] float vertex(int k, int axis, int lane) const {
        return row(static_cast<std::size_t>(axis))[corner(k, lane)];
    }
    [[gnu::always_inline]] std::int32_t prim_at(int lane) const {
        return std::bit_cast<std::int32_t>(row(prim_row)[lane]);
    }

    [[gnu::always_inline]] static constexpr std::size_t bytes(std::size_t vertices) {
        return (header_words + 3 * vertices + block_width) * sizeof(float);
    }
    // bytes() in units, rounded up.
    [[gnu::always_inline]] static constexpr std::size_t units(std::size_t vertices) { return vertices / 2; }
    [[gnu::always_inline]] std::size_t units() const { return units(vertices()); }
    [[gnu::always_inline]] const CompressedBlock* next() const { return this + units(); }
};
static_assert(sizeof(CompressedBlock) == unit_bytes);
static_assert(CompressedBlock::bytes(CompressedBlock::few_vertices) == 96 && CompressedBlock::units(6) == 3);
static_assert(CompressedBlock::bytes(CompressedBlock::most_vertices) == 120 && CompressedBlock::units(8) == 4);

// Most triangles of a leaf: each block takes at least two, because any two triangles have at most six vertices.
inline constexpr int max_compressed_leaf = 2 * max_leaf_blocks;

}  // namespace wive
