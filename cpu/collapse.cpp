#include "collapse.h"

#include <limits>

namespace wive {
namespace {

constexpr std::uint8_t fewer_slots = 0;  // share[i]: i - 1 slots do as well
constexpr std::uint8_t as_wide_node = 0, as_leaf = 1;  // share[1]

// Adds the slots of the subtree [begin, end) that may fill `allowed` slots; returns their order.
SlotSequences add_slots(const BinaryTree& tree, Treelet& treelet, std::uint32_t begin, std::uint32_t end,
                        std::uint32_t split, int allowed, int& count) {
    const bool one_block = end - begin <= block_width;
    if (!one_block) {
        const BinaryNode& node = tree.nodes[split];
        while (allowed > 1 && node.share[allowed] == fewer_slots) --allowed;
        if (allowed > 1) {
            int left_count = 0, right_count = 0;
            const int left_allowed = node.share[allowed];
            const SlotSequences left = add_slots(tree, treelet, begin, split, node.left, left_allowed, left_count);
            const SlotSequences right =
                add_slots(tree, treelet, split, end, node.right, allowed - left_allowed, right_count);
            count = left_count + right_count;
            return join(left, left_count, right, right_count, node.axis);
        }
    }
    const bool leaf = one_block || tree.nodes[split].share[1] == as_leaf;
    const int slot = treelet.count++;
    treelet.slots[static_cast<std::size_t>(slot)] = {begin, end, split, leaf};
    count = 1;
    return single_slot(static_cast<std::uint32_t>(slot));
}

}  // namespace

SlotCosts gather_costs(BinaryNode& node, const Box& box, const SlotCosts& left, const SlotCosts& right,
                       std::uint32_t largest_leaf) {
    const float area = box.half_area();
    SlotCosts costs;
    costs[0] = std::numeric_limits<float>::infinity();
    std::array<float, node_width + 1> shared;
    for (int i = 2; i <= node_width; ++i) {
        float best = std::numeric_limits<float>::infinity();
        std::uint8_t best_share = 1;
        for (int k = 1; k < i; ++k) {
            const float cost = left[static_cast<std::size_t>(k)] + right[static_cast<std::size_t>(i - k)];
            if (cost < best) {
                best = cost;
                best_share = static_cast<std::uint8_t>(k);
            }
        }
        shared[static_cast<std::size_t>(i)] = best;
        node.share[i] = best_share;
    }
    node.share[0] = node.share[node_width];
    const std::uint32_t blocks = blocks_for(node.end - node.begin);
    const float leaf = area * block_cost * static_cast<float>(blocks);
    const float wide = area * node_cost + shared[node_width];
    // The limit is asked apart from the costs, which are infinite both where coordinates are very large.
    const bool as_one = blocks <= largest_leaf && leaf <= wide;
    node.share[1] = as_one ? as_leaf : as_wide_node;
    costs[1] = as_one ? leaf : wide;
    for (std::size_t i = 2; i <= node_width; ++i) {
        if (shared[i] < costs[i - 1]) {
            costs[i] = shared[i];
        } else {
            costs[i] = costs[i - 1];
            node.share[i] = fewer_slots;
        }
    }
    return costs;
}

Treelet gather_treelet(const BinaryTree& tree, std::uint32_t split) {
    const BinaryNode& node = tree.nodes[split];
    Treelet treelet;
    int left_count = 0, right_count = 0;
    const int left_allowed = node.share[0];
    const SlotSequences left = add_slots(tree, treelet, node.begin, split, node.left, left_allowed, left_count);
    const SlotSequences right =
        add_slots(tree, treelet, split, node.end, node.right, node_width - left_allowed, right_count);
    treelet.order = join(left, left_count, right, right_count, node.axis);
    return treelet;
}

Treelet gather_root(const BinaryTree& tree) {
    if (tree.count > block_width) return gather_treelet(tree, tree.root);
    Treelet treelet;
    treelet.order = single_slot(0);
    if (tree.count > 0) treelet.slots[static_cast<std::size_t>(treelet.count++)] = {0, tree.count, 0, true};
    return treelet;
}

}  // namespace wive
