#include "build/emit.h"

#include <algorithm>
#include <cassert>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "build/any_hit_order.h"
#include "build/collapse.h"
#include "build/write_compressed.h"
#include "build/write_float32.h"
#include "build/write_node.h"
#include "core/ensure.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/ray.h"

namespace wive {

namespace {

// A thread emits one subtree at a time. There are about subtree_count of them, within these numbers of triangles.
constexpr std::uint32_t subtree_count = 64, largest_subtree = 1 << 14, smallest_subtree = 1 << 10;
// What a subtree of this size is written from is fetched beforehand: it fits the cache. Its references are fetched
// with those of a larger subtree around it, since what else is fetched depends on them.
constexpr std::uint32_t prefetched_size = 128, prefetched_refs = 4 * prefetched_size;

// A leaf's prims in ascending order. choose_collapse makes no leaf of more than max_leaf_blocks.
class LeafPrims {
public:
    LeafPrims(const BinaryTree& tree, const Subtree& leaf) : count_(leaf.size()) {
        ensure(count_ <= prims_.size(), "a leaf of at most max_leaf_blocks blocks");
        for (std::uint32_t i = 0; i < count_; ++i) prims_[i] = tree.refs[leaf.begin + i].prim();
        if (count_ <= block_width)
            sort_block();
        else
            std::sort(prims_.begin(), prims_.begin() + count_);
    }
    std::span<const std::uint32_t> span() const { return {prims_.data(), count_}; }

private:
    // A sorting network of five comparisons, without branches, which would be mispredicted.
    void sort_block() {
        static_assert(block_width == 4);
        constexpr std::array<std::array<std::size_t, 2>, 5> pairs{{{0, 1}, {2, 3}, {0, 2}, {1, 3}, {1, 2}}};
        std::fill(prims_.begin() + count_, prims_.begin() + block_width, no_prim);  // which sorts last
        for (const auto& [i, j] : pairs) {
            const std::uint32_t low = std::min(prims_[i], prims_[j]), high = std::max(prims_[i], prims_[j]);
            prims_[i] = low;
            prims_[j] = high;
        }
    }

    std::array<std::uint32_t, block_width * max_leaf_blocks> prims_;
    std::uint32_t count_;
};

// True if the sequence of every octant has each of the first `count` slots once.
bool is_permutation(const SlotSequences& order, int count) {
    return std::all_of(order.begin(), order.end(), [&](std::uint32_t sequence) {
        unsigned slots = 0;
        for (int i = 0; i < count; ++i) slots |= 1u << (sequence >> order_bits * i & 7u);
        return slots == (1u << count) - 1;
    });
}

// Plans the place of every node and leaf, then writes them. Writer has the format of nodes and blocks.
template <class Writer, class Real>
class Emitter {
    using StoredNode = typename Writer::Node;

public:
    Emitter(const BinaryTree& tree, const Mesh<Real>& mesh, const BuildOptions& options,
            const std::array<float, 3>& center)
        : tree_(tree), mesh_(mesh), options_(options), center_(center) {}

    using Size = TreeSize;

    EmittedTree emit(Threads& threads) {
        areas_ = ProjectedAreaPrefixSum(tree_, threads);
        // Plan the top of the tree, measure the subtrees below it, and give each its place. Then write them.
        Treelet root = collect_root_children(tree_);
        sort_slots_for_any_hit(tree_, areas_, root);
        std::vector<Part> subtrees;
        Size top = {1, 0};
        plan_top(root, 1, top, subtrees);
        {
            const ProgressPart measuring(0, 0);
            parallel_for(subtrees.size(), threads,
                         [&](std::size_t i) { subtrees[i].size = size_of(subtrees[i].slot); });
        }
        Size& total = total_ = top;
        for (Part& subtree : subtrees) {
            subtree.first = total;
            total.nodes += subtree.size.nodes;
            total.leaf_units += subtree.size.leaf_units;
        }
        const std::size_t node_bytes = total.nodes * sizeof(StoredNode);
        const std::size_t bytes = node_bytes + total.leaf_units * unit_bytes;
        if (bytes / unit_bytes > max_units) throw too_many_triangles(tree_.count);
        LargeArray<std::byte> units(bytes);
        nodes_ = reinterpret_cast<StoredNode*>(units.data());
        leaves_ = units.data() + node_bytes;
        first_leaf_unit_ = node_bytes / unit_bytes;
        const std::size_t count = subtrees.size() + 1;  // and one task for the top
        parallel_for(count, threads, [&](std::size_t i) {
            const std::size_t k = scattered(i, count);
            if (k == subtrees.size()) {
                std::size_t next_node = 1;
                const Part* next_subtree = subtrees.data();
                emit_top(root, 0, next_node, next_subtree);
                ensure(next_node == top.nodes && next_subtree == subtrees.data() + subtrees.size(),
                       "as many top nodes written as planned");
            } else if (Part& subtree = subtrees[k]; !subtree.slot.leaf) {
                Size at = subtree.first;
                subtree.depth += emit_subtree(subtree.slot, subtree.node, at);
                ensure_filled(subtree, at);
            }
        });
        int depth = 1;
        for (const Part& subtree : subtrees) depth = std::max(depth, subtree.depth);
        return {std::move(units), total.nodes, depth};
    }

private:
    // A slot of a top node. One thread emits the node or leaf in it and everything below.
    struct Part {
        Slot slot;
        std::size_t node;  // index of its own node
        int depth;         // planned: of the node above, the root's being 1; emitted: of the deepest node below
        Size size = {}, first = {};
    };
    using Children = std::array<std::uint32_t, node_width>;

    static std::uint32_t node_child(std::size_t node) { return inner_child(node * (sizeof(StoredNode) / unit_bytes)); }

    // What was written must be what was planned: the next part begins there.
    static void ensure_filled(const Part& part, const Size& end) {
        const Size planned = part.first + part.size;
        ensure(end.nodes == planned.nodes && end.leaf_units == planned.leaf_units,
               "as many nodes and leaf units written as planned");
    }

    bool is_top(const Slot& slot) const { return !slot.leaf && slot.tree.size() > subtree_size_; }

    Treelet treelet_of(const Slot& slot) const {
        Treelet treelet = collect_children(tree_, slot.tree);
        sort_slots_for_any_hit(tree_, areas_, treelet);
        return treelet;
    }

    static std::size_t inner_count(const Treelet& treelet) {
        return static_cast<std::size_t>(std::count_if(treelet.slots.begin(), treelet.slots.begin() + treelet.count,
                                                      [](const Slot& slot) { return !slot.leaf; }));
    }

    void plan_top(const Treelet& treelet, int depth, Size& top, std::vector<Part>& subtrees) const {
        std::size_t child_node = top.nodes;
        top.nodes += inner_count(treelet);
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& slot = treelet.slots[static_cast<std::size_t>(i)];
            const std::size_t node = slot.leaf ? 0 : child_node++;
            if (is_top(slot))
                plan_top(treelet_of(slot), depth + 1, top, subtrees);
            else
                subtrees.push_back({slot, node, depth});
        }
    }

    Size size_of(const Slot& slot) const {
        return measure(tree_, slot, [&](const Subtree& leaf) -> std::size_t {
            if constexpr (requires { Writer::leaf_units(leaf.size()); })
                return Writer::leaf_units(leaf.size());
            else
                return Writer::leaf_size(mesh_, LeafPrims(tree_, leaf).span()).units;
        });
    }

    void emit_top(const Treelet& treelet, std::size_t place, std::size_t& next_node, const Part*& next_subtree) {
        std::size_t child_node = next_node;
        next_node += inner_count(treelet);
        Children children;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& slot = treelet.slots[static_cast<std::size_t>(i)];
            std::uint32_t& child = children[static_cast<std::size_t>(i)];
            const std::size_t node = slot.leaf ? 0 : child_node++;
            child = node_child(node);
            if (is_top(slot)) {
                emit_top(treelet_of(slot), node, next_node, next_subtree);
            } else {
                const Part& part = *next_subtree++;
                if (!slot.leaf) continue;
                Size at = part.first;
                child = write_leaf(slot, at);
                ensure_filled(part, at);
            }
        }
        write_node(place, treelet, children);
    }

    // Emits a subtree from `cursor` on. Returns its depth in nodes.
    int emit_subtree(const Slot& slot, std::size_t place, Size& cursor, bool prefetched = false) {
        if (slot.tree.size() <= prefetched_refs && slot.tree.size() > prefetched_size) prefetch_refs(slot.tree);
        if (!prefetched && slot.tree.size() <= prefetched_size) {
            prefetched = true;
            prefetch(slot.tree);
        }
        const Treelet treelet = treelet_of(slot);
        Children children;
        std::size_t child_node = cursor.nodes;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& child = treelet.slots[static_cast<std::size_t>(i)];
            children[static_cast<std::size_t>(i)] = child.leaf ? write_leaf(child, cursor) : node_child(cursor.nodes++);
        }
        write_node(place, treelet, children);
        int deepest = 0;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& child = treelet.slots[static_cast<std::size_t>(i)];
            if (!child.leaf) deepest = std::max(deepest, emit_subtree(child, child_node++, cursor, prefetched));
        }
        return deepest + 1;
    }

    // Fetches what is read to emit a subtree and lies anywhere in memory.
    void prefetch(const Subtree& tree) const {
        tree_.prefetch_nodes(tree);
        for (std::uint32_t i = tree.begin; i < tree.end; ++i) mesh_.prefetch_face(tree_.refs[i].prim());
        for (std::uint32_t i = tree.begin; i < tree.end; ++i) mesh_.prefetch_corners(tree_.refs[i].prim());
    }

    // Some hundred at once: the references of one subtree don't lie behind those of the one before, so no processor
    // foresees where they begin.
    void prefetch_refs(const Subtree& tree) const {
        for (std::uint32_t i = tree.begin; i < tree.end; i += 2) __builtin_prefetch(&tree_.refs[i]);
    }

    void write_node(std::size_t place, const Treelet& treelet, const Children& children) const {
        ensure(place < total_.nodes, "as many nodes as planned");
        Node node;
        for (int i = 0; i < node_width; ++i) {
            write_box(node, i, i < treelet.count ? treelet.slots[static_cast<std::size_t>(i)].box : Box{}, center_);
            node.child[i] = i < treelet.count ? children[static_cast<std::size_t>(i)] : end_of_stack;
        }
        ensure(is_permutation(treelet.order, treelet.count), "an order row of permutations");
        write_order(node, treelet.order, treelet.count);
        Writer::write_node(node, treelet.count, nodes_[place]);
    }

    std::uint32_t write_leaf(const Slot& slot, Size& cursor) const {
        const LeafPrims prims(tree_, slot.tree);
        const std::size_t first = cursor.leaf_units;
        ensure(first <= total_.leaf_units, "as many leaf units as planned");
        const LeafSize size =
            Writer::write_leaf(mesh_, options_.accuracy, prims.span(),
                               {leaves_ + first * unit_bytes, leaves_ + total_.leaf_units * unit_bytes});
        cursor.leaf_units += size.units;
        ensure(size.blocks >= 1 && size.blocks <= max_leaf_blocks, "a leaf of 1 to 8 blocks");
        return leaf_child(first_leaf_unit_ + first, size.blocks);
    }

    const BinaryTree& tree_;
    const Mesh<Real>& mesh_;
    const BuildOptions& options_;
    const std::array<float, 3>& center_;
    std::uint32_t subtree_size_ = std::clamp(tree_.count / subtree_count, smallest_subtree, largest_subtree);
    ProjectedAreaPrefixSum areas_;
    Size total_ = {};
    StoredNode* nodes_ = nullptr;
    std::byte* leaves_ = nullptr;
    std::size_t first_leaf_unit_ = 0;
};

}  // namespace

template <class Real>
EmittedTree emit_tree(const BinaryTree& tree, const Mesh<Real>& mesh, const BuildOptions& options,
                      const std::array<float, 3>& center, Threads& threads) {
    using Compressed =
        std::conditional_t<precision_of<Real> == Precision::float32, CompressedWriter, CompressedFloat64Writer>;
    if (options.nodes == NodeForm::compressed)
        return Emitter<Compressed, Real>(tree, mesh, options, center).emit(threads);
    return Emitter<Float32Writer<Real>, Real>(tree, mesh, options, center).emit(threads);
}

template EmittedTree emit_tree(const BinaryTree&, const Mesh<float>&, const BuildOptions&, const std::array<float, 3>&,
                               Threads&);
template EmittedTree emit_tree(const BinaryTree&, const Mesh<double>&, const BuildOptions&, const std::array<float, 3>&,
                               Threads&);

}  // namespace wive
