// From the binary tree to wide nodes: which subtrees become slots of which node, and where each node goes.
//
// SlotCosts[i] is the least cost of a subtree when it may fill i slots of the wide node above it: a dynamic
// programme over the binary tree (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs
// Through Compressed Wide BVHs", section 3.1), with leaves counted in blocks of four triangles.
#pragma once

#include <array>
#include <cstddef>

#include "build/binary_tree.h"
#include "build/order.h"

namespace wive {

// Costs with one to eight slots, never rising: lanes of two vectors.
struct SlotCosts {
    Float4v first, second;  // 1 to 4, 5 to 8
    bool one_block;         // all alike
};

// Costs of a range small enough for one block: one slot is enough, more don't help.
inline SlotCosts block_costs(const Box& box) {
    const Float4v cost = Float4v{} + box.half_area() * block_cost;
    return {cost, cost, true};
}

// Stores the node of a subtree, split there, whose sides cost so much; returns its own costs.
SlotCosts store_node(BinaryTree& tree, const Subtree& top, const Box& box, std::uint32_t split, int axis,
                     const SlotCosts& left, const SlotCosts& right);

// A wide node's child: as a leaf or as a wide node.
struct Slot {
    Subtree tree;
    bool leaf;
};

struct Treelet {
    std::array<Slot, node_width> slots;
    int count = 0;
    SlotSequences order;
};

// The treelet that the dynamic programme chose for the wide node over a whole subtree that has a node.
Treelet gather_treelet(const BinaryTree& tree, const Subtree& top);
// The same for the root, which is a wide node even over a single block.
Treelet gather_root(const BinaryTree& tree);

// How many slots the left side gets; 0: the subtree is one slot. `allowed` falls to what is used.
inline int left_share(const Choices& choices, int& allowed) {
    while (allowed > 1 && choices.share(allowed) == 0) --allowed;
    return allowed > 1 ? choices.share(allowed) : 0;
}

// Wide nodes, and units of memory for leaves.
struct TreeSize {
    std::size_t nodes = 0, leaf_units = 0;

    friend TreeSize operator+(const TreeSize& a, const TreeSize& b) {
        return {a.nodes + b.nodes, a.leaf_units + b.leaf_units};
    }
};

// What a subtree that may fill `allowed` slots adds to the tree. leaf_units(subtree): what a leaf takes.
template <class LeafUnits>
TreeSize measure(const BinaryTree& tree, const Subtree& top, int allowed, const LeafUnits& leaf_units) {
    if (!top.has_node()) return {0, leaf_units(top)};
    const BinaryNode node = tree.node(top);
    int share = left_share(node.choices, allowed);
    TreeSize own = {};
    if (share == 0) {
        if (node.choices.as_leaf()) return {0, leaf_units(top)};
        share = node.choices.wide_share();
        allowed = node_width;
        own.nodes = 1;
    }
    return own + measure(tree, top.left(node.split), share, leaf_units) +
           measure(tree, top.right(node.split), allowed - share, leaf_units);
}

// What is below a slot, without the slot's own node.
template <class LeafUnits>
TreeSize measure(const BinaryTree& tree, const Slot& slot, const LeafUnits& leaf_units) {
    if (slot.leaf) return {0, leaf_units(slot.tree)};
    const BinaryNode node = tree.node(slot.tree);
    const int share = node.choices.wide_share();
    return measure(tree, slot.tree.left(node.split), share, leaf_units) +
           measure(tree, slot.tree.right(node.split), node_width - share, leaf_units);
}

}  // namespace wive
