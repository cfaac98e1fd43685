#include "build/reinsertion.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "build/collapse.h"
#include "core/parallel.h"
#include "core/progress.h"

namespace wive {
namespace {

constexpr std::uint32_t none = ~0u;
constexpr std::size_t chunk_size = 1 << 10;  // searches differ much in length
constexpr int max_recursion = 512;           // levels
constexpr int rounds = 3;                    // each gains less than half of what the one before did
// What a move must save, in multiples of the moved subtree's own area. Smaller savings lower the SAH cost but not the
// steps of rays, because they make siblings overlap.
constexpr float least_gain = 1;
// Bounds on the work of a round, in nodes looked at. If boxes overlap everywhere, as those of long triangles do, each
// search would visit most of the tree. On the scenes of docs/scenes.md a search takes 35 steps on average and 170 at
// most: there the bounds change the cost by less than a thousandth. With longer searches among long triangles the cost
// is not lower.
constexpr std::uint32_t longest_search = 96;
constexpr std::size_t steps_per_triangle = 48;

// A node of the tree while it changes. Leaves are the blocks that binning made. Single triangles as leaves take three
// times as long and leave blocks emptier, for a cost that is a few percent lower on some scenes and higher on others.
struct LinkedNode {
    Box box;
    std::array<std::uint32_t, 2> child;  // leaves: none, then the first reference
    std::uint32_t parent;
    std::uint32_t count;  // references below; count_refs sets it for inner nodes

    bool is_leaf() const { return child[0] == none; }
    std::uint32_t first_ref() const {
        assert(is_leaf());
        return child[1];
    }
    std::uint32_t other_child(std::uint32_t node) const {
        assert(child[0] == node || child[1] == node);
        return child[0] == node ? child[1] : child[0];
    }
    void replace_child(std::uint32_t node, std::uint32_t by) {
        assert(child[0] == node || child[1] == node);
        child[child[0] == node ? 0 : 1] = by;
    }
};
static_assert(sizeof(LinkedNode) == 48);

Box joined(const Box& a, const Box& b) {
    Box box = a;
    box.grow(b);
    return box;
}

bool are_equal(const Box& a, const Box& b) {
    const Int4v equal = (a.lo == b.lo) & (a.hi == b.hi);
    return (equal[0] & equal[1] & equal[2]) != 0;
}

class LinkedTree {
public:
    explicit LinkedTree(const BinaryTree& tree)
        : nodes_(2 * std::size_t{tree.count}), area_scale_(tree.area_scale), count_(tree.count) {
        root_ = link(tree, tree.root());
        nodes_[root_].parent = none;
    }

    void optimize(Threads& threads) {
        for (int i = 0; i < rounds; ++i) {
            const ProgressPart round(static_cast<double>(i) / rounds, static_cast<double>(i + 1) / rounds);
            if (!improve(threads)) return;
        }
    }

    const LinkedNode& operator[](std::uint32_t i) const { return nodes_[i]; }
    LinkedNode& operator[](std::uint32_t i) { return nodes_[i]; }
    std::uint32_t root() const { return root_; }

private:
    struct Move {
        float gain = 0;
        std::uint32_t node = none, target = none;
    };

    std::uint32_t link(const BinaryTree& tree, const Subtree& top) {
        const std::uint32_t place = used_++;
        LinkedNode& node = nodes_[place];
        if (!top.has_node()) {
            node = {{}, {none, top.begin}, none, top.size()};
            for (std::uint32_t ref = top.begin; ref < top.end; ++ref) node.box.grow(tree.refs[ref].box());
            return place;
        }
        const std::uint32_t split = tree.node(top).split;
        node = {tree.box_of(top), {link(tree, top.left(split)), link(tree, top.right(split))}, none, 0};
        for (const std::uint32_t child : node.child) nodes_[child].parent = place;
        return place;
    }

    std::size_t most_steps() const { return steps_per_triangle * count_; }
    float area_of(const Box& box) const { return box.half_area(area_scale_); }
    std::uint32_t sibling(std::uint32_t node) const { return nodes_[nodes_[node].parent].other_child(node); }

    // The target next to which the subtree enlarges the tree least; none if no place gains least_gain. Of the places
    // that `steps` allow to look at; lowers `steps` by those taken.
    // Meister and Bittner's algorithm 2: walk up from the subtree's parent and search each sibling's subtree on the
    // way. Below a node, at least the moved subtree's own area is added, which bounds the search.
    Move find_move(std::uint32_t node, std::vector<std::pair<float, std::uint32_t>>& stack,
                   std::uint32_t& steps) const {
        stack.clear();
        const Box box = nodes_[node].box;
        const float area = area_of(box);
        Move best{least_gain * area, node, none};
        std::uint32_t pivot = nodes_[node].parent, other = sibling(node);
        Box pivot_box = nodes_[other].box;         // the pivot's box without the moved subtree
        float saved = area_of(nodes_[pivot].box);  // area that removing the subtree saves
        for (;;) {
            stack.push_back({saved, other});
            while (!stack.empty()) {
                if (steps == 0) return best;
                --steps;
                const auto [here, target] = stack.back();
                stack.pop_back();
                if (here - area <= best.gain) continue;
                const LinkedNode& at = nodes_[target];
                const float enlarged = area_of(joined(at.box, box));
                if (here - enlarged > best.gain) best.gain = here - enlarged, best.target = target;
                const float below = here + area_of(at.box) - enlarged;
                if (!at.is_leaf() && below - area > best.gain) {
                    stack.push_back({below, at.child[0]});
                    stack.push_back({below, at.child[1]});
                }
            }
            if (nodes_[pivot].parent == none || steps == 0) return best;
            --steps;
            if (pivot != nodes_[node].parent) saved += area_of(nodes_[pivot].box) - area_of(pivot_box);
            other = sibling(pivot);
            pivot_box.grow(nodes_[other].box);
            pivot = nodes_[pivot].parent;
        }
    }

    // One round. False if nothing moved.
    bool improve(Threads& threads) {
        std::vector<Move> moves(used_);
        parallel_chunks(used_, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
            std::vector<std::pair<float, std::uint32_t>> stack;
            std::size_t left = most_steps() * (end - begin) / used_;
            for (std::size_t i = begin; i < end && left > 0; ++i) {
                const std::uint32_t node = static_cast<std::uint32_t>(i);
                if (node == root_ || nodes_[node].parent == root_) continue;
                const auto allowed = static_cast<std::uint32_t>(std::min<std::size_t>(left, longest_search));
                std::uint32_t steps = allowed;
                moves[i] = find_move(node, stack, steps);
                left -= allowed - steps;
            }
        });
        std::erase_if(moves, [](const Move& move) { return move.target == none; });
        std::sort(moves.begin(), moves.end(), [](const Move& a, const Move& b) {
            return a.gain > b.gain || (a.gain == b.gain && a.node < b.node);
        });
        std::size_t moved = 0;
        steps_ = 0;
        for (const Move& move : moves)
            if (steps_ < most_steps()) moved += apply(move);
        return moved > 0;
    }

    // Moves a subtree, if that still gains after the moves before it. False if it does not.
    bool apply(const Move& move) {
        const std::uint32_t parent = nodes_[move.node].parent, other = sibling(move.node);
        if (parent == root_ || move.target == parent || move.target == other) return false;
        float gain = area_of(nodes_[parent].box);
        gain += remove(parent, other);
        bool target_is_outside = true;  // of the moved subtree, into which an earlier move may have taken the target
        for (std::uint32_t i = move.target; i != none && target_is_outside; i = nodes_[i].parent, ++steps_)
            target_is_outside = i != move.node;
        if (target_is_outside) {
            gain -= insert(move.node, parent, move.target);
            if (gain > 0) return true;
            remove(parent, move.target);
        }
        insert(move.node, parent, other);
        return false;
    }

    // Removes `parent` and one of its children: `other`, its other child, takes its place. Returns by how much the
    // nodes above shrink.
    float remove(std::uint32_t parent, std::uint32_t other) {
        const std::uint32_t above = nodes_[parent].parent;
        nodes_[above].replace_child(parent, other);
        nodes_[other].parent = above;
        float shrunk = 0;
        for (std::uint32_t i = above; i != none; i = nodes_[i].parent, ++steps_) {
            LinkedNode& at = nodes_[i];
            const Box box = joined(nodes_[at.child[0]].box, nodes_[at.child[1]].box);
            if (are_equal(box, at.box)) break;
            shrunk += area_of(at.box) - area_of(box);
            at.box = box;
        }
        return shrunk;
    }

    // Inserts `parent`, as the parent of `node` and `target`, in target's place. Returns by how much the tree grows.
    float insert(std::uint32_t node, std::uint32_t parent, std::uint32_t target) {
        const std::uint32_t above = nodes_[target].parent;
        nodes_[above].replace_child(target, parent);
        nodes_[parent].parent = above;
        nodes_[parent].child = {node, target};
        nodes_[node].parent = nodes_[target].parent = parent;
        nodes_[parent].box = joined(nodes_[node].box, nodes_[target].box);
        float grown = area_of(nodes_[parent].box);
        for (std::uint32_t i = above; i != none; i = nodes_[i].parent, ++steps_) {
            LinkedNode& at = nodes_[i];
            const Box box = joined(at.box, nodes_[node].box);
            if (are_equal(box, at.box)) break;
            grown += area_of(box) - area_of(at.box);
            at.box = box;
        }
        return grown;
    }

    LargeArray<LinkedNode> nodes_;
    float area_scale_;
    std::size_t count_;      // references
    std::size_t steps_ = 0;  // nodes that the moves of this round have looked at
    std::uint32_t used_ = 0, root_ = 0;
};

// Sets the counts of inner nodes. Returns the tree's depth.
int count_refs(LinkedTree& linked) {
    struct Entry {
        std::uint32_t node;
        int depth;
    };
    std::vector<Entry> order = {{linked.root(), 1}};
    int depth = 1;
    for (std::size_t i = 0; i < order.size(); ++i) {
        const auto [node, at] = order[i];
        depth = std::max(depth, at);
        if (linked[node].is_leaf()) continue;
        for (const std::uint32_t child : linked[node].child) order.push_back({child, at + 1});
    }
    for (std::size_t i = order.size(); i-- > 0;) {
        LinkedNode& node = linked[order[i].node];
        if (!node.is_leaf()) node.count = linked[node.child[0]].count + linked[node.child[1]].count;
    }
    return depth;
}

// Writes a linked tree's references and nodes to a BinaryTree.
class BinaryTreeWriter {
public:
    BinaryTreeWriter(const LinkedTree& linked, BinaryTree& tree) : linked_(linked), tree_(tree), refs_(tree.count) {}

    void write() {
        write_subtree(linked_.root(), tree_.root());
        tree_.refs = std::move(refs_);
    }

private:
    SlotCosts write_subtree(std::uint32_t index, const Subtree& top) {
        const LinkedNode& node = linked_[index];
        if (!top.has_node()) {
            std::uint32_t place = top.begin;
            write_block(index, place);
            return block_costs(node.box, tree_.area_scale);
        }
        auto [left, right] = node.child;
        const Float4v a = linked_[left].box.lo + linked_[left].box.hi,
                      b = linked_[right].box.lo + linked_[right].box.hi;
        const Float4v apart = b - a;
        int axis = 0;
        for (int k = 1; k < 3; ++k)
            if (std::abs(apart[k]) > std::abs(apart[axis])) axis = k;
        if (apart[axis] < 0) std::swap(left, right);
        const std::uint32_t split = top.begin + linked_[left].count;
        const SlotCosts left_costs = write_subtree(left, top.left(split)),
                        right_costs = write_subtree(right, top.right(split));
        return store_node(tree_, top, node.box, split, axis, left_costs, right_costs);
    }

    void write_block(std::uint32_t index, std::uint32_t& place) {
        const LinkedNode& node = linked_[index];
        if (node.is_leaf()) {
            for (std::uint32_t i = 0; i < node.count; ++i) refs_[place++] = tree_.refs[node.first_ref() + i];
            return;
        }
        for (const std::uint32_t child : node.child) write_block(child, place);
    }

    const LinkedTree& linked_;
    BinaryTree& tree_;
    LargeArray<PrimRef> refs_;
};

}  // namespace

bool optimize_by_reinsertion(BinaryTree& tree, Threads& threads) {
    if (tree.count <= block_width) return true;
    LinkedTree linked(tree);
    linked.optimize(threads);
    if (count_refs(linked) > max_recursion) return false;
    BinaryTreeWriter(linked, tree).write();
    return true;
}

}  // namespace wive
