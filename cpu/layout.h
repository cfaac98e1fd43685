// What the tree looks like in memory: the one description that every backend traverses.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wive {

inline constexpr int node_width = 8;
inline constexpr int block_width = 4;

// An inner node: eight rows of eight lanes, one lane a child. Planes are relative to BvhView::center and
// rounded outwards. Lane i of `order` packs, for each of the eight sign octants o, the slot that comes i-th
// from front to back: (order[i] >> 4 * o) & 7. Octant bit a is set where the ray is negative on axis a.
// Octant 7 - o is the reverse of octant o. Empty lanes hold an inverted box that nothing hits.
struct alignas(64) Node {
    float planes[6][node_width];  // lo.x hi.x lo.y hi.y lo.z hi.z
    std::uint32_t child[node_width];
    std::uint32_t order[node_width];
};
static_assert(sizeof(Node) == 256);

// Four triangles side by side. rows[3 * k + axis] holds vertex k (watertight), or v0, v1 - v0, v2 - v0 (fast).
// Unused lanes hold NaN, which passes no test, and prim -1.
struct alignas(32) TriangleBlock {
    float rows[9][block_width];
    std::int32_t prim[block_width];
};
static_assert(sizeof(TriangleBlock) == 160);

// A child reference: an inner node's index, or with leaf_bit set the first block and the number of blocks.
inline constexpr std::uint32_t leaf_bit = 0x80000000u;
inline constexpr int max_leaf_blocks = 8;
inline constexpr std::uint32_t max_blocks = (1u << 28) - max_leaf_blocks;
inline constexpr std::uint32_t end_of_stack = 0xffffffffu;  // no leaf: max_blocks leaves it free

constexpr bool is_inner(std::uint32_t child) { return (child & leaf_bit) == 0; }
constexpr std::uint32_t leaf_child(std::uint32_t first_block, std::uint32_t blocks) {
    return leaf_bit | first_block << 3 | (blocks - 1);
}
constexpr std::uint32_t leaf_first_block(std::uint32_t child) { return (child & ~leaf_bit) >> 3; }
constexpr std::uint32_t leaf_block_count(std::uint32_t child) { return (child & 7u) + 1; }

// The builder never makes a tree deeper than this (see binary_tree.cpp). One visit pops one entry and pushes
// at most eight, so a way from the root down leaves at most seven entries a level behind.
inline constexpr int max_depth = 64;
inline constexpr int max_stack = 1 + 7 * max_depth;

enum class Accuracy { fast, watertight };
inline constexpr int accuracy_count = 2;

struct BvhView {
    const Node* nodes;  // nodes[0] is the root, always an inner node
    const TriangleBlock* blocks;
    float center[3];  // planes are relative to this point
    float extent[3];  // the largest |plane| on each axis
};

// Coordinates beyond this are refused: products of three of them must stay finite in double, of two in float.
inline constexpr float max_coordinate = 1e18f;

}  // namespace wive
