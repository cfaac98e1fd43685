// From the binary tree to wide nodes: which subtrees become slots of which node, and where each node goes.
//
// SlotCosts[i] is the least cost of a subtree when it may fill i slots of the wide node above it: a dynamic
// programme over the binary tree (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs
// Through Compressed Wide BVHs", section 3.1), with leaves counted in blocks of four triangles.
#pragma once

#include <array>
#include <cstddef>

#include "binary_tree.h"
#include "order.h"

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

// Wide nodes and blocks below a slot, without the slot's own node.
struct TreeSize {
    std::size_t nodes = 0, blocks = 0;
};
TreeSize measure(const BinaryTree& tree, const Slot& slot);

}  // namespace wive
