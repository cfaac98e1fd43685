// What the tree looks like in memory: the one description that every backend traverses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace wive {

inline constexpr int node_width = 8;
inline constexpr int block_width = 4;
inline constexpr std::size_t unit_bytes = 32;  // what child references count in

// What a scene's numbers are: vertices, rays, t, u and v. Boxes are float32 in either. In templates: Real, float or
// double.
enum class Precision { float32, float64 };
template <class Real>
inline constexpr Precision precision_of = std::is_same_v<Real, double> ? Precision::float64 : Precision::float32;

// An inner node: eight rows of eight lanes, one lane a child. Planes are relative to BvhView::center and
// rounded outwards. Lane i of `order` packs, for each of the eight sign octants o, the slot that comes i-th
// from front to back: (order[i] >> 4 * o) & 7. Octant bit a is set where the ray is negative on axis a.
// Octant 7 - o is the reverse of octant o. Empty lanes hold an inverted box that nothing hits.
struct alignas(64) Node {
    float planes[6][node_width];  // lo.x hi.x lo.y hi.y lo.z hi.z
    std::uint32_t child[node_width];
    std::uint32_t order[node_width];

    double plane(int row, int lane) const { return planes[row][lane]; }
};
static_assert(sizeof(Node) == 256);

// Four triangles side by side. rows[3 * k + axis] holds vertex k, or v0, v1 - v0, v2 - v0 (fast).
// Unused lanes hold NaN, which passes no test, and prim -1.
template <class Real>
struct alignas(32) TriangleBlockOf {
    Real rows[9][block_width];
    std::int32_t prim[block_width];

    // Always inlined, as all that kernels call: a copy compiled for one instruction set must not be linked into
    // another.
    [[gnu::always_inline]] Real vertex(int k, int axis, int lane) const {
        return rows[3 * k + axis][lane];
    }  // but in `fast` trees
    [[gnu::always_inline]] std::int32_t prim_at(int lane) const { return prim[lane]; }
    [[gnu::always_inline]] const TriangleBlockOf* next() const { return this + 1; }
    [[gnu::always_inline]] static constexpr std::size_t units() { return sizeof(TriangleBlockOf) / unit_bytes; }
};
using TriangleBlock = TriangleBlockOf<float>;
static_assert(sizeof(TriangleBlock) == 160 && sizeof(TriangleBlockOf<double>) == 320);

// What a tree is stored as: the nodes and blocks above, or those of compressed.h.
enum class NodeForm { float32, compressed };
inline constexpr int node_form_count = 2;

// Nodes and blocks stand in one piece of memory, first the nodes, then the blocks, counted in units of unit_bytes:
// a node is eight units, a block five (compressed: four, and three or four; of doubles ten, whatever the nodes). A
// child reference holds the unit where the child begins, times eight; a leaf sets leaf_bit and puts its number of
// blocks, less one, in the low three bits. So one mask and one shift lead to a child of either kind.
inline constexpr std::size_t max_units = std::size_t{1} << 28;
inline constexpr std::uint32_t leaf_bit = 0x80000000u;
inline constexpr int max_leaf_blocks = 8;
inline constexpr std::uint32_t end_of_stack = 0xffffffffu;  // no child: max_units leaves it free

constexpr bool is_inner(std::uint32_t child) { return (child & leaf_bit) == 0; }
constexpr std::uint32_t inner_child(std::size_t unit) { return static_cast<std::uint32_t>(unit) << 3; }
constexpr std::uint32_t leaf_child(std::size_t unit, std::uint32_t blocks) {
    return leaf_bit | static_cast<std::uint32_t>(unit) << 3 | (blocks - 1);
}
constexpr std::size_t child_offset(std::uint32_t child) { return std::size_t{child & 0x7ffffff8u} * (unit_bytes / 8); }
constexpr std::uint32_t leaf_block_count(std::uint32_t child) { return (child & 7u) + 1; }
// The rest of a leaf of several blocks, the first of which takes so many units.
constexpr std::uint32_t without_first_block(std::uint32_t child, std::size_t units) {
    return child + (static_cast<std::uint32_t>(units) << 3) - 1;
}

// The builder never makes a tree deeper than this (see binary_tree.cpp). One visit pops one entry and pushes
// at most eight, so a way from the root down leaves at most seven entries a level behind.
inline constexpr int max_depth = 64;
inline constexpr int max_stack = 1 + 7 * max_depth;

enum class Accuracy { fast, watertight, exact };
inline constexpr int accuracy_count = 3;

struct BvhView {
    const std::byte* units;       // begins with the root, always an inner node
    alignas(16) float center[4];  // planes are relative to this point; the fourth lane is zero
    alignas(16) float extent[4];  // the largest |plane| on each axis

    template <class Form>
    [[gnu::always_inline]] const typename Form::Node& node(
        std::uint32_t child) const {  // an inner child has nothing to mask
        return *reinterpret_cast<const typename Form::Node*>(units + std::size_t{child} * (unit_bytes / 8));
    }
    template <class Form>
    [[gnu::always_inline]] const typename Form::Block* leaf(std::uint32_t child) const {
        return reinterpret_cast<const typename Form::Block*>(units + child_offset(child));
    }
};

// Coordinates beyond this are refused: products of two of them must stay finite in float,
// and boxes are float32 in either precision.
template <class Real>
inline constexpr Real max_coordinate = static_cast<Real>(1e18);

}  // namespace wive
