// Collapse of the binary tree into wide nodes: which subtrees become slots of which node.
//
// A dynamic programme over the binary tree finds the least cost of each subtree in 1 to 8 slots of the wide node above
// it (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
// section 3.1). Here leaves are counted in blocks of four triangles.
#pragma once

#include <array>
#include <cstddef>

#include "build/binary_tree.h"
#include "build/order.h"

namespace wive {

// The least costs of a subtree in up to 1, 2, ... 8 slots.
struct SlotCosts {
    Float4v first, second;  // 1 to 4 slots, 5 to 8 slots
    bool one_block;         // the subtree is one block: all eight are equal
};

// Costs of a range small enough for one block: more slots do not lower them. scale: the tree's area_scale.
inline SlotCosts block_costs(const Box& box, float scale) {
    const Float4v cost = Float4v{} + box.half_area(scale) * block_cost;
    return {cost, cost, true};
}

// Stores the node of a subtree whose right side begins at `split`. left, right: the costs of its sides. Returns its
// own.
SlotCosts store_node(BinaryTree& tree, const Subtree& top, const Box& box, std::uint32_t split, int axis,
                     const SlotCosts& left, const SlotCosts& right);

// A child of a wide node.
struct Slot {
    Subtree tree;
    bool leaf;  // else a wide node
    Box box;
};

// The children of a wide node and their order for each octant.
struct Treelet {
    std::array<Slot, node_width> slots;
    int count = 0;
    SlotSequences order;
};

// The children that the dynamic programme chose for the wide node over a subtree, which must have a binary node.
Treelet collect_children(const BinaryTree& tree, const Subtree& top);
// The children of the root, which is a wide node even over a single block.
Treelet collect_root_children(const BinaryTree& tree);

// How many of `allowed` slots the left side gets, or 0 if the subtree takes one slot. Lowers `allowed` to the number of
// slots that are used.
inline int left_slots_of(const CollapseDecision& decision, int& allowed) {
    while (allowed > 1 && decision.left_slots(allowed) == 0) --allowed;
    return allowed > 1 ? decision.left_slots(allowed) : 0;
}

// Number of wide nodes, and of units of memory that leaves take.
struct TreeSize {
    std::size_t nodes = 0, leaf_units = 0;

    friend TreeSize operator+(const TreeSize& a, const TreeSize& b) {
        return {a.nodes + b.nodes, a.leaf_units + b.leaf_units};
    }
};

// The size of a subtree that may fill `allowed` slots. leaf_units(subtree): the units that a leaf takes.
template <class LeafUnits>
TreeSize measure(const BinaryTree& tree, const Subtree& top, int allowed, const LeafUnits& leaf_units) {
    if (!top.has_node()) return {0, leaf_units(top)};
    // Nodes lie where their ranges are, so that no processor foresees the next: they are fetched some hundreds at once.
    constexpr std::uint32_t most_fetched = 512;
    if (top.size() <= most_fetched && top.size() > most_fetched / 2) tree.prefetch_nodes(top);
    const BinaryNode node = tree.node(top);
    int left_slots = left_slots_of(node.decision, allowed);
    TreeSize own = {};
    if (left_slots == 0) {
        if (node.decision.as_leaf()) return {0, leaf_units(top)};
        left_slots = node.decision.left_slots_as_node();
        allowed = node_width;
        own.nodes = 1;
    }
    return own + measure(tree, top.left(node.split), left_slots, leaf_units) +
           measure(tree, top.right(node.split), allowed - left_slots, leaf_units);
}

// The size of what is below a slot, without the slot's own node.
template <class LeafUnits>
TreeSize measure(const BinaryTree& tree, const Slot& slot, const LeafUnits& leaf_units) {
    if (slot.leaf) return {0, leaf_units(slot.tree)};
    const BinaryNode node = tree.node(slot.tree);
    const int left_slots = node.decision.left_slots_as_node();
    return measure(tree, slot.tree.left(node.split), left_slots, leaf_units) +
           measure(tree, slot.tree.right(node.split), node_width - left_slots, leaf_units);
}

}  // namespace wive
