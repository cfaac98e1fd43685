#include "build/collapse.h"

#include <bit>
#include <limits>

namespace wive {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

// Adds the slots of a subtree that may fill `allowed` slots; returns their order.
SlotSequences add_slots(const BinaryTree& tree, Treelet& treelet, const Subtree& top, int allowed, int& count) {
    bool leaf = true;
    if (top.has_node()) {
        const BinaryNode node = tree.node(top);
        if (const int share = left_share(node.choices, allowed)) {
            int left_count = 0, right_count = 0;
            const SlotSequences left = add_slots(tree, treelet, top.left(node.split), share, left_count);
            const SlotSequences right = add_slots(tree, treelet, top.right(node.split), allowed - share, right_count);
            count = left_count + right_count;
            return join(left, left_count, right, right_count, node.choices.axis());
        }
        leaf = node.choices.as_leaf();
    }
    const int slot = treelet.count++;
    treelet.slots[static_cast<std::size_t>(slot)] = {top, leaf};
    count = 1;
    return single_slot(static_cast<std::uint32_t>(slot));
}

// Values with 1 to 8 slots.
template <class Vector>
struct Slots {
    Vector first, second;
};

// Least sums over the ways to share i slots, and the left side's shares in the places that Choices gives them. Of equal
// sums the one that gives the left side fewest slots.
void share_slots(const SlotCosts& left, SlotCosts right, Slots<Float4v>& least, Slots<Int4v>& shares) {
    const Int4v one_first = {1 << 0, 1 << 3, 1 << 6, 1 << 9}, one_second = {1 << 12, 1 << 15, 1 << 18, 1 << 21};
    const Float4v none = Float4v{} + infinity;
    least = {none, none};
    shares = {one_first, one_second};
    const float left_costs[] = {left.first[0],  left.first[1],  left.first[2], left.first[3],
                                left.second[0], left.second[1], left.second[2]};
    const int most = left.one_block ? 1 : node_width - 1;
    for (int k = 1; k <= most; ++k) {
        // The left side takes k slots: the right side has i - k.
        right.second = __builtin_shufflevector(right.first, right.second, 3, 4, 5, 6);
        right.first = __builtin_shufflevector(none, right.first, 0, 4, 5, 6);
        const Float4v first = left_costs[k - 1] + right.first, second = left_costs[k - 1] + right.second;
        shares.first = first < least.first ? k * one_first : shares.first;
        shares.second = second < least.second ? k * one_second : shares.second;
        least.first = minimum(first, least.first);
        least.second = minimum(second, least.second);
    }
}

// The best way to gather a subtree of so many blocks, half its box's area; `costs` is set to what it costs.
Choices gather(std::uint32_t blocks, std::uint32_t largest_leaf, float half_area, const SlotCosts& left,
               const SlotCosts& right, int axis, SlotCosts& costs) {
    Slots<Float4v> shared;
    Slots<Int4v> shares;
    share_slots(left, right, shared, shares);
    const std::uint32_t wide_share = static_cast<std::uint32_t>(shares.second[3]) >> 21;

    const float leaf = half_area * block_cost * static_cast<float>(blocks);
    const float wide = half_area * node_cost + shared.second[3];
    // The limit is asked apart from the costs, which are infinite both where coordinates are very large.
    const bool as_leaf = blocks <= largest_leaf && leaf <= wide;
    const Float4v one = Float4v{} + (as_leaf ? leaf : wide);
    shared.first[0] = one[0];
    costs = {minimum(shared.first, one), minimum(shared.second, one), false};

    // A slot more that doesn't help is not used.
    const Float4v fewer_first = __builtin_shufflevector(costs.first, costs.first, 0, 0, 1, 2);
    const Float4v fewer_second = __builtin_shufflevector(costs.first, costs.second, 3, 4, 5, 6);
    const Int4v used = (shares.first & (shared.first < fewer_first)) | (shares.second & (shared.second < fewer_second));
    const std::uint32_t bits = static_cast<std::uint32_t>(used[0] | used[1] | used[2] | used[3]);
    return {bits | (as_leaf ? 1u : 0u), wide_share, axis};
}

}  // namespace

SlotCosts store_node(BinaryTree& tree, const Subtree& top, const Box& box, std::uint32_t split, int axis,
                     const SlotCosts& left, const SlotCosts& right) {
    SlotCosts costs;
    const Choices choices =
        gather(blocks_for(top.size()), tree.largest_leaf, box.half_area(), left, right, axis, costs);
    tree.nodes[top.place] = std::bit_cast<PrimRef>(
        BinaryNode{{box.lo[0], box.lo[1], box.lo[2]}, split, {box.hi[0], box.hi[1], box.hi[2]}, choices});
    return costs;
}

Treelet gather_treelet(const BinaryTree& tree, const Subtree& top) {
    const BinaryNode node = tree.node(top);
    Treelet treelet;
    int left_count = 0, right_count = 0;
    const int share = node.choices.wide_share();
    const SlotSequences left = add_slots(tree, treelet, top.left(node.split), share, left_count);
    const SlotSequences right = add_slots(tree, treelet, top.right(node.split), node_width - share, right_count);
    treelet.order = join(left, left_count, right, right_count, node.choices.axis());
    return treelet;
}

Treelet gather_root(const BinaryTree& tree) {
    if (tree.root().has_node()) return gather_treelet(tree, tree.root());
    Treelet treelet;
    treelet.order = single_slot(0);
    if (tree.count > 0) treelet.slots[static_cast<std::size_t>(treelet.count++)] = {tree.root(), true};
    return treelet;
}

}  // namespace wive
