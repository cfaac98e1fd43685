// The binary tree that is collapsed into wide nodes.
#pragma once

#include <bit>
#include <cassert>
#include <cstdint>

#include "build/mesh.h"
#include "core/box.h"
#include "core/large_array.h"
#include "core/layout.h"
#include "core/parallel.h"

namespace wive {

// Surface area cost, in units of one node visit or one triangle block test; Embree's measure.
inline constexpr float node_cost = 1.0f;
inline constexpr float block_cost = 1.0f;

constexpr std::uint32_t blocks_for(std::uint32_t prims) { return (prims + block_width - 1) / block_width; }

// The cheapest way to collapse a subtree into slots of a wide node (see collapse.h), and the subtree's split axis, in
// 32 bits.
class CollapseDecision {
public:
    CollapseDecision() = default;
    // left_slots: left_slots(i) in bits slot_bits * (i - 1).
    constexpr CollapseDecision(std::uint32_t left_slots, std::uint32_t left_slots_as_node, int axis)
        : bits_(left_slots | left_slots_as_node << as_node_shift | static_cast<std::uint32_t>(axis) << axis_shift) {
        assert(left_slots >> as_node_shift == 0 && left_slots_as_node <= slot_mask && axis >= 0 && axis < 3);
    }

    // How many of i slots, 2 to 8, the left child gets. 0: the subtree costs as little in i - 1 slots.
    constexpr int left_slots(int i) const {
        assert(i >= 2 && i <= node_width);
        return static_cast<int>(bits_ >> slot_bits * (i - 1) & slot_mask);
    }
    // Whether in one slot the subtree is a leaf, or else a wide node.
    constexpr bool as_leaf() const { return (bits_ & slot_mask) != 0; }
    // How many of that wide node's eight slots the left child gets.
    constexpr int left_slots_as_node() const { return static_cast<int>(bits_ >> as_node_shift & slot_mask); }
    constexpr int axis() const { return static_cast<int>(bits_ >> axis_shift); }

    static constexpr int slot_bits = 3;

private:
    static constexpr std::uint32_t slot_mask = (1u << slot_bits) - 1;
    static constexpr int as_node_shift = slot_bits * node_width, axis_shift = as_node_shift + slot_bits;

    std::uint32_t bits_ = 0;
};

// An inner node over references [begin, end), a range that follows from its parent's. Ranges of at most block_width
// references are leaves and have no node.
struct alignas(16) BinaryNode {
    float lo[3];
    std::uint32_t split;  // the first reference of the right side
    float hi[3];
    CollapseDecision decision;
};
static_assert(sizeof(BinaryNode) == sizeof(PrimRef));

// A range of references and the place of its node, if it has one. A left child's node is at the place of its last
// reference, a right child's at that of its first: no two nodes share a place then (Karras 2012, "Maximizing
// Parallelism in the Construction of BVHs, Octrees, and k-d Trees"), so threads need no locks and the tree does not
// depend on their number.
struct Subtree {
    std::uint32_t begin, end, place;

    std::uint32_t size() const { return end - begin; }
    bool has_node() const { return size() > block_width; }
    Subtree left(std::uint32_t split) const {
        assert(begin < split && split < end);
        return {begin, split, split - 1};
    }
    Subtree right(std::uint32_t split) const {
        assert(begin < split && split < end);
        return {split, end, split};
    }
};

struct BinaryTree {
    LargeArray<PrimRef> refs;   // in leaf order
    LargeArray<PrimRef> nodes;  // in memory that held references while the tree was built; read by node()
    std::uint32_t count = 0;
    std::uint32_t largest_leaf = max_leaf_blocks;  // in blocks of four triangles
    Box box;
    float area_scale = 1;  // for half_area()

    Subtree root() const { return {0, count, 0}; }
    BinaryNode node(const Subtree& tree) const {
        assert(tree.has_node());
        return std::bit_cast<BinaryNode>(nodes[tree.place]);
    }
    // Fetches the nodes below a subtree.
    void prefetch_nodes(const Subtree& tree) const {
        for (std::uint32_t i = tree.begin; i < tree.end; i += 2) __builtin_prefetch(&nodes[i]);
    }
    Box box_of(const Subtree& tree) const {
        if (tree.has_node()) return nodes[tree.place].box();
        Box box;
        for (std::uint32_t i = tree.begin; i < tree.end; ++i) box.grow(refs[i].box());
        return box;
    }
};

// A tree by binned SAH, leaf cost counted in blocks of four. The same tree on any number of threads. At most
// depth_limit levels deep, if bit_width(blocks) levels are within it: ranges whose remainder could be deeper are halved
// by number, which takes bit_width(blocks) levels.
BinaryTree build_binary_tree(PrimRefs refs, Threads& threads, int depth_limit, std::uint32_t largest_leaf);

}  // namespace wive
