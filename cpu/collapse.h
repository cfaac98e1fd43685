// From the binary tree to wide nodes: which subtrees become slots of which node, and where each node goes.
//
// SlotCosts[i] is the least cost of a subtree when it may fill i slots of the wide node above it: a dynamic
// programme over the binary tree (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs
// Through Compressed Wide BVHs", section 3.1), with leaves counted in blocks of four triangles.
#pragma once

#include <array>
#include <vector>

#include "binary_tree.h"
#include "order.h"

namespace wive {

using SlotCosts = std::array<float, node_width + 1>;

// Costs of a range small enough for one block: one slot is enough, more don't help.
inline SlotCosts block_costs(const Box& box) {
    SlotCosts costs;
    costs.fill(box.half_area() * block_cost);
    return costs;
}

// Fills in node.share and returns the node's costs. largest_leaf: in blocks of four.
SlotCosts gather_costs(BinaryNode& node, const Box& box, const SlotCosts& left, const SlotCosts& right,
                       std::uint32_t largest_leaf);

// A wide node's child: the references [begin, end), as a leaf or, at its binary split position, as a wide node.
struct Slot {
    std::uint32_t begin, end, split;
    bool leaf;
};

struct Treelet {
    std::array<Slot, node_width> slots;
    int count = 0;
    SlotSequences order;
};

// The treelet that the dynamic programme chose for the wide node over the whole range of `split`.
Treelet gather_treelet(const BinaryTree& tree, std::uint32_t split);
// The same for the root, which is a wide node even over a single block.
Treelet gather_root(const BinaryTree& tree);

}  // namespace wive
