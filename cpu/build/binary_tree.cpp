#include "build/binary_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>
#include <vector>

#include "build/binned_split.h"
#include "build/collapse.h"
#include "core/parallel.h"
#include "core/progress.h"

namespace wive {
namespace {

constexpr std::size_t chunk_size = 1 << 13;        // references per step of a parallel split
constexpr std::uint32_t parallel_range = 1 << 15;  // each larger range is split by all threads
// Smaller ranges are split by one thread each, until there are about task_count of them or they are smaller than
// smallest_task, for which a task of its own costs more than it saves.
constexpr std::uint32_t task_count = 64, smallest_task = 1 << 12;

struct Halves {
    Range left, right;
    int axis = 0;

    Halves(const Range& range, std::uint32_t middle, int split_axis)
        : left{range.tree.left(middle), range.depth + 1, {}, {}},
          right{range.tree.right(middle), range.depth + 1, {}, {}},
          axis(split_axis) {}
};

// A range near the root. Its halves are items too, or else one thread builds the subtree over it.
struct Item {
    Range range;
    bool in_scratch;       // whether its references are in tree.nodes, else in tree.refs
    std::size_t left = 0;  // its halves are items[left] and items[left + 1]; 0: none
    int axis = 0;
    SlotCosts costs{};
};

// References are in two arrays of equal size, tree.refs and tree.nodes. Near the root, every split moves a range's
// references from one array to the other. Below, they are in tree.refs, and tree.nodes is first the scratch memory for
// the right side of a split, then holds the nodes.
class TreeBuilder {
public:
    TreeBuilder(BinaryTree& tree, Threads& threads, int depth_limit)
        : tree_(tree), threads_(threads), depth_limit_(depth_limit) {}

    void build(const Box& centroids) {
        items_.push_back({{tree_.root(), 0, tree_.box, centroids}, false});
        // About how often a reference moves: once per level of the tree, down to the blocks.
        const double levels = std::bit_width(blocks_for(tree_.count)),
                     moves = levels * static_cast<double>(tree_.count);
        const double top = std::max(0.0, levels - std::bit_width(blocks_for(parallel_range))) / levels;
        double moved = 0;
        for (std::size_t i = 0; i < items_.size(); ++i) {
            const std::uint32_t size = items_[i].range.tree.size();
            if (size <= parallel_range) continue;
            const double before = std::min(top, moved / moves);
            const ProgressPart split(before, before);
            moved += size;
            const bool from_scratch = items_[i].in_scratch;
            const Halves halves = split_parallel(items_[i].range, from_scratch);
            items_[i].left = items_.size();
            items_[i].axis = halves.axis;
            items_.push_back({halves.left, !from_scratch});
            items_.push_back({halves.right, !from_scratch});
        }
        {
            const ProgressPart splits(top, top);
            while (split_items()) {
            }
        }
        const ProgressPart rest(top, 1);
        std::vector<std::size_t> tasks = leaf_items(0);
        std::sort(tasks.begin(), tasks.end(), [&](std::size_t a, std::size_t b) {
            return items_[a].range.tree.size() > items_[b].range.tree.size();
        });
        parallel_for(tasks.size(), threads_, [&](std::size_t i) {
            Item& item = items_[tasks[i]];
            item.costs = build_range(item.range, item.in_scratch);
        });
        for (std::size_t i = items_.size(); i-- > 0;) {
            Item& item = items_[i];
            if (item.left == 0) continue;
            const Item &left = items_[item.left], &right = items_[item.left + 1];
            item.costs = store_node(tree_, item.range.tree, item.range.box, right.range.tree.begin, item.axis,
                                    left.costs, right.costs);
        }
    }

private:
    // Items without halves of more than `size` references.
    std::vector<std::size_t> leaf_items(std::uint32_t size) const {
        std::vector<std::size_t> leaves;
        for (std::size_t i = 0; i < items_.size(); ++i)
            if (items_[i].left == 0 && items_[i].range.tree.size() > size) leaves.push_back(i);
        return leaves;
    }

    // Splits the items that are too large for a task, one thread per item. False if there are none.
    bool split_items() {
        const std::vector<std::size_t> large = leaf_items(std::max(smallest_task, tree_.count / task_count));
        const std::size_t first = items_.size();
        items_.resize(first + 2 * large.size());
        parallel_for(large.size(), threads_, [&](std::size_t i) {
            Item& item = items_[large[i]];
            const Halves halves = split_serial(item.range, item.in_scratch);
            item.left = first + 2 * i;
            item.axis = halves.axis;
            items_[item.left] = {halves.left, false};
            items_[item.left + 1] = {halves.right, false};
        });
        return !large.empty();
    }

    // Copies a range's references to tree.refs, unless they are there. Returns tree.refs.
    PrimRef* move_to_refs(const Range& range, bool from_scratch) const {
        const Subtree& r = range.tree;
        if (from_scratch)
            std::copy(tree_.nodes.data() + r.begin, tree_.nodes.data() + r.end, tree_.refs.data() + r.begin);
        return tree_.refs.data();
    }

    // Whether SAH may choose the split: halving by number must still be able to finish within depth_limit.
    bool sah_allowed(const Range& range) const {
        return range.depth + static_cast<int>(std::bit_width(blocks_for(range.tree.size()))) < depth_limit_;
    }

    // Builds the subtree over a range on this thread.
    SlotCosts build_range(const Range& range, bool from_scratch = false) {
        if (!range.tree.has_node()) {
            move_to_refs(range, from_scratch);
            return block_costs(range.box, tree_.area_scale);
        }
        const Halves halves = split_serial(range, from_scratch);
        const SlotCosts left = build_range(halves.left);
        const SlotCosts right = build_range(halves.right);
        return store_node(tree_, range.tree, range.box, halves.right.tree.begin, halves.axis, left, right);
    }

    static int longest_axis(const Range& range) {
        const Float4v extent = range.centroids.hi - range.centroids.lo;
        int axis = 0;
        for (int k = 1; k < 3; ++k)
            if (extent[k] > extent[axis]) axis = k;
        return axis;
    }

    // Splits at the median along the longest axis of the centroids. Possible for any centroids, and balanced.
    static Halves split_by_number(const Range& range, PrimRef* refs) {
        const auto [begin, end, place] = range.tree;
        const int axis = longest_axis(range);
        const std::uint32_t middle = begin + (blocks_for(end - begin) + 1) / 2 * block_width;
        Halves halves(range, std::min(middle, end - 1), axis);
        std::nth_element(refs + begin, refs + halves.right.tree.begin, refs + end,
                         [axis](const PrimRef& a, const PrimRef& b) {
                             const float x = a.centroid()[axis], y = b.centroid()[axis];
                             return x < y || (x == y && a.prim() < b.prim());
                         });
        for (Range* half : {&halves.left, &halves.right})
            for (std::uint32_t i = half->tree.begin; i < half->tree.end; ++i) half->grow(refs[i]);
        return halves;
    }

    // Copies references to `left` or `right` and advances that pointer. Branch-free, because the side is unpredictable:
    // every reference is written to both. So neither pointer may be ahead of `ref`, unless it is into another array.
    static void partition(const PrimRef* begin, const PrimRef* end, const BinMap& bin_of, Split split, PrimRef*& left,
                          PrimRef*& right) {
        for (const PrimRef* ref = begin; ref < end; ++ref) {
            const bool goes_left = bin_of.goes_left(*ref, split);
            const PrimRef copy = *ref;
            *left = copy;
            *right = copy;
            left += goes_left;
            right += !goes_left;
        }
    }

    // Splits a range on this thread. Both sides are in tree.refs afterwards.
    Halves split_serial(const Range& range, bool from_scratch) const {
        if (!sah_allowed(range)) return split_by_number(range, move_to_refs(range, from_scratch));
        const auto [begin, end, place] = range.tree;
        PrimRef *refs = tree_.refs.data(), *scratch = tree_.nodes.data();
        const PrimRef* from = from_scratch ? scratch : refs;
        const BinMap bin_of(range);
        Bins bins(bin_of.count);
        bins.add(from + begin, from + end, bin_of);
        const Split split = best_split(bins, bin_of, tree_.area_scale);
        if (split.axis < 0) return split_by_number(range, move_to_refs(range, from_scratch));
        PrimRef *left = refs + begin, *right = scratch + begin;
        partition(from + begin, from + end, bin_of, split, left, right);
        Halves halves(range, static_cast<std::uint32_t>(left - refs), split.axis);
        for (const PrimRef* ref = refs + begin; ref < left; ++ref) halves.left.grow(*ref);
        for (const PrimRef* ref = scratch + begin; ref < right; ++ref) {
            halves.right.grow(*ref);
            *left++ = *ref;
        }
        return halves;
    }

    // Splits a range on all threads. Each chunk is binned on its own, then copied to the other array, to places that
    // follow from the bins. The result depends on the chunks, whose size is fixed, and not on the number of threads.
    Halves split_parallel(const Range& range, bool from_scratch) {
        PrimRef* from = (from_scratch ? tree_.nodes : tree_.refs).data();
        PrimRef* to = (from_scratch ? tree_.refs : tree_.nodes).data();
        const std::uint32_t first = range.tree.begin, size = range.tree.size();
        const BinMap bin_of(range);
        const std::size_t chunks = (size + chunk_size - 1) / chunk_size;
        std::vector<Bins> parts(chunks, Bins(bin_of.count));
        parallel_chunks(size, chunk_size, threads_, [&](std::size_t begin, std::size_t end) {
            parts[begin / chunk_size].add(from + first + begin, from + first + end, bin_of);
        });
        Bins bins(bin_of.count);
        for (const Bins& part : parts) bins.add(part, bin_of.count);
        const Split split = sah_allowed(range) ? best_split(bins, bin_of, tree_.area_scale) : Split{};
        if (split.axis < 0) {
            const Halves halves = split_by_number(range, from);
            std::copy(from + first, from + range.tree.end, to + first);
            return halves;
        }
        Halves halves(range, first + bins.count_left(split), split.axis);
        // Where each chunk's left and right references go.
        std::vector<std::array<PrimRef*, 2>> places(chunks + 1);
        places[0] = {to + first, to + halves.right.tree.begin};
        for (std::size_t i = 0; i < chunks; ++i) {
            const std::size_t left = parts[i].count_left(split);
            places[i + 1] = {places[i][0] + left, places[i][1] + std::min(chunk_size, size - i * chunk_size) - left};
        }
        std::vector<std::array<Range, 2>> sides(chunks);
        parallel_chunks_scattered(size, chunk_size, threads_, [&](std::size_t begin, std::size_t end) {
            const std::size_t chunk = begin / chunk_size;
            partition_chunk(from + first + begin, from + first + end, bin_of, split, places[chunk]);
            for (std::size_t side = 0; side < 2; ++side)
                for (const PrimRef* ref = places[chunk][side]; ref < places[chunk + 1][side]; ++ref)
                    sides[chunk][side].grow(*ref);
        });
        for (const auto& [left, right] : sides) {
            halves.left.grow(left);
            halves.right.grow(right);
        }
        return halves;
    }

    static void partition_chunk(const PrimRef* begin, const PrimRef* end, const BinMap& bin_of, Split split,
                                std::array<PrimRef*, 2> to) {
        auto [left, right] = to;
        for (const PrimRef* ref = begin; ref < end; ++ref) {
            const bool goes_left = bin_of.goes_left(*ref, split);
            *(goes_left ? left : right) = *ref;
            left += goes_left;
            right += !goes_left;
        }
    }

    BinaryTree& tree_;
    std::vector<Item> items_;
    Threads& threads_;
    int depth_limit_;
};

}  // namespace

BinaryTree build_binary_tree(PrimRefs refs, Threads& threads, int depth_limit, std::uint32_t largest_leaf) {
    BinaryTree tree;
    tree.largest_leaf = largest_leaf;
    tree.refs = std::move(refs.refs);
    tree.nodes = LargeArray<PrimRef>(refs.count);
    tree.count = refs.count;
    tree.box = refs.box;
    tree.area_scale = area_scale(refs.box);
    if (tree.count > block_width) TreeBuilder(tree, threads, depth_limit).build(refs.centroids);
    return tree;
}

}  // namespace wive
