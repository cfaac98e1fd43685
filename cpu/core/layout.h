// Layout of the tree in memory. Every backend traverses this one layout.
#pragma once

#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace wive {

static_assert(std::endian::native == std::endian::little, "trees are stored and shared in this byte order");

inline constexpr int node_width = 8;           // children of a node
inline constexpr int block_width = 4;          // triangles of a block
inline constexpr std::size_t unit_bytes = 32;  // child references address memory in units of this size

// The scalar type of a scene's vertices and rays, and of t, u and v. Boxes are float32 for both. A template parameter
// named Real is float or double.
enum class Precision { float32, float64 };
template <class Real>
inline constexpr Precision precision_of = std::is_same_v<Real, double> ? Precision::float64 : Precision::float32;

// Rows of a node's planes: lo.x hi.x lo.y hi.y lo.z hi.z.
inline constexpr int plane_rows = 6;
constexpr int low_row(int axis) { return 2 * axis; }
constexpr int high_row(int axis) { return 2 * axis + 1; }

// A sign octant has bit a set if the ray is negative on axis a. An order row has one word per lane: lane i holds, in
// order_bits bits per octant, the slot that comes i-th from front to back, (order[i] >> order_bits * octant) & 7.
inline constexpr int octants = 8;
inline constexpr int order_bits = 4;

// An inner node: eight rows of eight lanes, one lane per child. Planes are relative to BvhView::center and moved
// outwards by the slack of write_node.h. The order of octant 7 - o is the reverse of octant o's. Lanes without a child
// hold an inverted box that nothing hits.
struct alignas(64) Node {
    float planes[plane_rows][node_width];
    std::uint32_t child[node_width];
    std::uint32_t order[node_width];

    double plane(int row, int lane) const { return planes[row][lane]; }
};
static_assert(sizeof(Node) == 256);

// Rows of a block's triangles: three axes of vertex 0, then of vertices 1 and 2.
inline constexpr int triangle_rows = 9;
constexpr int triangle_row(int vertex, int axis) { return 3 * vertex + axis; }

// Four triangles, one per lane. Fast trees hold v0, v1 - v0 and v2 - v0 in place of the three vertices. Unused lanes
// hold NaN, which passes no test, and prim -1.
template <class Real>
struct alignas(32) TriangleBlockOf {
    Real rows[triangle_rows][block_width];
    std::int32_t prim[block_width];

    // Always inlined, as everything that kernels call: a copy compiled for one instruction set must not be linked into
    // another. Not for fast trees.
    [[gnu::always_inline]] Real vertex(int k, int axis, int lane) const { return rows[triangle_row(k, axis)][lane]; }
    [[gnu::always_inline]] std::int32_t prim_at(int lane) const { return prim[lane]; }
    [[gnu::always_inline]] const TriangleBlockOf* next() const { return this + 1; }
    [[gnu::always_inline]] static constexpr std::size_t units() { return sizeof(TriangleBlockOf) / unit_bytes; }
};
using TriangleBlock = TriangleBlockOf<float>;
static_assert(sizeof(TriangleBlock) == 160 && sizeof(TriangleBlockOf<double>) == 320);

// float32: the nodes and blocks above. compressed: those of compressed.h.
enum class NodeForm { float32, compressed };
inline constexpr int node_form_count = 2;

// One allocation, all nodes then all triangle blocks, addressed in units of unit_bytes:
//                 float32   compressed   float64 (float32 / compressed nodes)
//   node             8          4            8 / 4
//   block            5        3 or 4           10
// Child reference: bit 31 leaf; bits 3-30 unit index; bits 0-2, leaves only, block count - 1. One mask and one
// multiplication address a child of either kind.
inline constexpr int unit_shift = 3;
inline constexpr std::size_t max_units = std::size_t{1} << 28;
inline constexpr std::uint32_t leaf_bit = 0x80000000u;
inline constexpr std::uint32_t block_count_mask = (1u << unit_shift) - 1;
inline constexpr std::uint32_t unit_mask = ~(leaf_bit | block_count_mask);
inline constexpr std::size_t bytes_per_reference_step = unit_bytes >> unit_shift;
inline constexpr int max_leaf_blocks = 8;
static_assert(max_leaf_blocks - 1 == block_count_mask);
// No child's reference: a tree has at most max_units (emit_tree refuses larger ones), and no leaf begins in the last.
inline constexpr std::uint32_t end_of_stack = 0xffffffffu;

constexpr bool is_inner(std::uint32_t child) { return (child & leaf_bit) == 0; }
constexpr std::uint32_t inner_child(std::size_t unit) {
    assert(unit < max_units);
    return static_cast<std::uint32_t>(unit) << unit_shift;
}
constexpr std::uint32_t leaf_child(std::size_t unit, std::uint32_t blocks) {
    assert(unit < max_units && blocks >= 1 && blocks <= max_leaf_blocks);
    return leaf_bit | static_cast<std::uint32_t>(unit) << unit_shift | (blocks - 1);
}
constexpr std::size_t child_offset(std::uint32_t child) {
    return std::size_t{child & unit_mask} * bytes_per_reference_step;
}
constexpr std::uint32_t leaf_block_count(std::uint32_t child) { return (child & block_count_mask) + 1; }
// The rest of a leaf of several blocks; units: the size of its first block.
constexpr std::uint32_t without_first_block(std::uint32_t child, std::size_t units) {
    return child + (static_cast<std::uint32_t>(units) << unit_shift) - 1;
}

// Depth of the deepest tree that the builder makes (see build_binary_tree). A visit pops one stack entry and pushes at
// most eight, so every level leaves at most seven entries on the stack.
inline constexpr int max_depth = 64;
inline constexpr int max_stack = 1 + (node_width - 1) * max_depth;

enum class Accuracy { fast, watertight, exact };
inline constexpr int accuracy_count = 3;

// A tree as kernels see it.
struct BvhView {
    const std::byte* units;       // begins with the root, which is always an inner node
    alignas(16) float center[4];  // planes are relative to this point; lane 3 is zero
    alignas(16) float extent[4];  // the largest |coordinate - center| on each axis; lane 3 is zero
    float far_away;  // from farther off the centre, the slack of the boxes (frame.h) is larger than many triangles

    // child must be inner: no bits need to be masked off then.
    template <class Form>
    [[gnu::always_inline]] const typename Form::Node& node(std::uint32_t child) const {
        assert(is_inner(child) && (child & block_count_mask) == 0);
        return *reinterpret_cast<const typename Form::Node*>(units + std::size_t{child} * bytes_per_reference_step);
    }
    template <class Form>
    [[gnu::always_inline]] const typename Form::Block* leaf(std::uint32_t child) const {
        assert(!is_inner(child) && child != end_of_stack);
        return reinterpret_cast<const typename Form::Block*>(units + child_offset(child));
    }
};

// Larger coordinates are refused: a product of two must be finite in float, and boxes are float32 for both precisions.
template <class Real>
inline constexpr Real max_coordinate = static_cast<Real>(1e18);

}  // namespace wive
