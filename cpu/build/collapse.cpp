#include "build/collapse.h"

#include <bit>
#include <limits>

#include "core/ensure.h"

namespace wive {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

// Adds the slots of a subtree that may fill `allowed` slots. Returns their order; count: how many there are.
SlotSequences add_slots(const BinaryTree& tree, Treelet& treelet, const Subtree& top, int allowed, int& count) {
    bool leaf = true;
    if (top.has_node()) {
        const BinaryNode node = tree.node(top);
        if (const int left_slots = left_slots_of(node.decision, allowed)) {
            int left_count = 0, right_count = 0;
            const SlotSequences left = add_slots(tree, treelet, top.left(node.split), left_slots, left_count);
            const SlotSequences right =
                add_slots(tree, treelet, top.right(node.split), allowed - left_slots, right_count);
            count = left_count + right_count;
            return join(left, left_count, right, right_count, node.decision.axis());
        }
        leaf = node.decision.as_leaf();
    }
    ensure(treelet.count < node_width, "a node of at most 8 children");
    const int slot = treelet.count++;
    treelet.slots[static_cast<std::size_t>(slot)] = {top, leaf, tree.box_of(top)};
    count = 1;
    return single_slot(static_cast<std::uint32_t>(slot));
}

// Values for 1 to 4 slots and for 5 to 8.
template <class Vector>
struct PerSlotCount {
    Vector first, second;
};

// The least cost of both sides over all ways to divide i slots between them, and the left side's slots in the bits
// where CollapseDecision has them. Of equal costs the way with the fewest slots on the left.
void divide_slots(const SlotCosts& left, SlotCosts right, PerSlotCount<Float4v>& least,
                  PerSlotCount<Int4v>& left_slots) {
    constexpr int bits = CollapseDecision::slot_bits;
    const Int4v one_first = {1, 1 << bits, 1 << 2 * bits, 1 << 3 * bits}, one_second = one_first << 4 * bits;
    const Float4v none = Float4v{} + infinity;
    least = {none, none};
    left_slots = {one_first, one_second};
    const float left_costs[] = {left.first[0],  left.first[1],  left.first[2], left.first[3],
                                left.second[0], left.second[1], left.second[2]};
    const int most = left.one_block ? 1 : node_width - 1;
    for (int k = 1; k <= most; ++k) {
        // The left side has k slots, so shift the right side's costs: lane i gets those of i - k slots.
        right.second = __builtin_shufflevector(right.first, right.second, 3, 4, 5, 6);
        right.first = __builtin_shufflevector(none, right.first, 0, 4, 5, 6);
        const Float4v first = left_costs[k - 1] + right.first, second = left_costs[k - 1] + right.second;
        left_slots.first = first < least.first ? k * one_first : left_slots.first;
        left_slots.second = second < least.second ? k * one_second : left_slots.second;
        least.first = minimum(first, least.first);
        least.second = minimum(second, least.second);
    }
}

// The cheapest way to collapse a subtree. blocks, half_area: its size and half its box's area; left, right: the costs
// of its sides. Sets `costs` to its own.
CollapseDecision choose_collapse(std::uint32_t blocks, std::uint32_t largest_leaf, float half_area,
                                 const SlotCosts& left, const SlotCosts& right, int axis, SlotCosts& costs) {
    PerSlotCount<Float4v> divided;
    PerSlotCount<Int4v> left_slots;
    divide_slots(left, right, divided, left_slots);
    constexpr int last_slot_shift = CollapseDecision::slot_bits * (node_width - 1);
    const std::uint32_t left_slots_as_node = static_cast<std::uint32_t>(left_slots.second[3]) >> last_slot_shift;

    const float leaf = half_area * block_cost * static_cast<float>(blocks);
    const float wide = half_area * node_cost + divided.second[3];
    const bool as_leaf = blocks <= largest_leaf && leaf <= wide;
    const Float4v one = Float4v{} + (as_leaf ? leaf : wide);
    divided.first[0] = one[0];
    costs = {minimum(divided.first, one), minimum(divided.second, one), false};

    // A slot that does not lower the cost is not used.
    const Float4v fewer_first = __builtin_shufflevector(costs.first, costs.first, 0, 0, 1, 2);
    const Float4v fewer_second = __builtin_shufflevector(costs.first, costs.second, 3, 4, 5, 6);
    const Int4v used =
        (left_slots.first & (divided.first < fewer_first)) | (left_slots.second & (divided.second < fewer_second));
    const std::uint32_t bits = static_cast<std::uint32_t>(used[0] | used[1] | used[2] | used[3]);
    return {bits | (as_leaf ? 1u : 0u), left_slots_as_node, axis};
}

}  // namespace

SlotCosts store_node(BinaryTree& tree, const Subtree& top, const Box& box, std::uint32_t split, int axis,
                     const SlotCosts& left, const SlotCosts& right) {
    SlotCosts costs;
    const CollapseDecision decision = choose_collapse(blocks_for(top.size()), tree.largest_leaf,
                                                      box.half_area(tree.area_scale), left, right, axis, costs);
    tree.nodes[top.place] = std::bit_cast<PrimRef>(
        BinaryNode{{box.lo[0], box.lo[1], box.lo[2]}, split, {box.hi[0], box.hi[1], box.hi[2]}, decision});
    return costs;
}

Treelet collect_children(const BinaryTree& tree, const Subtree& top) {
    const BinaryNode node = tree.node(top);
    Treelet treelet;
    int left_count = 0, right_count = 0;
    const int left_slots = node.decision.left_slots_as_node();
    const SlotSequences left = add_slots(tree, treelet, top.left(node.split), left_slots, left_count);
    const SlotSequences right = add_slots(tree, treelet, top.right(node.split), node_width - left_slots, right_count);
    treelet.order = join(left, left_count, right, right_count, node.decision.axis());
    return treelet;
}

Treelet collect_root_children(const BinaryTree& tree) {
    if (tree.root().has_node()) return collect_children(tree, tree.root());
    Treelet treelet;
    treelet.order = single_slot(0);
    if (tree.count > 0) treelet.slots[static_cast<std::size_t>(treelet.count++)] = {tree.root(), true, tree.box};
    return treelet;
}

}  // namespace wive
