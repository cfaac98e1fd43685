#include "binary_tree.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <vector>

#include "binned_split.h"
#include "collapse.h"
#include "parallel.h"

namespace wive {
namespace {

constexpr std::size_t chunk_size = 1 << 13;        // references per step of a parallel split
constexpr std::uint32_t parallel_range = 1 << 15;  // larger ranges are split by all threads together

struct Halves {
    Range left, right;
    int axis;
};

class TreeBuilder {
public:
    TreeBuilder(BinaryTree& tree, unsigned threads, int depth_limit, std::uint32_t largest_leaf)
        : tree_(tree),
          scratch_(tree.count > parallel_range ? tree.count : 0),
          threads_(threads),
          depth_limit_(depth_limit),
          largest_leaf_(largest_leaf) {}

    void build() {
        struct Item {
            Range range;
            bool in_scratch = false;
            std::size_t left = 0;  // its two halves stand at items[left] and items[left + 1]; 0: none
            std::uint32_t split = 0;
            SlotCosts costs{};
        };
        std::vector<Item> items;
        items.push_back({whole_range()});
        for (std::size_t i = 0; i < items.size(); ++i) {
            if (items[i].range.size() <= parallel_range) continue;
            const bool from_scratch = items[i].in_scratch;
            const Halves halves = split_together(items[i].range, from_scratch);
            items[i].left = items.size();
            items[i].split = store_node(items[i].range, halves);
            items.push_back({halves.left, !from_scratch});
            items.push_back({halves.right, !from_scratch});
        }
        std::vector<std::size_t> tasks;
        for (std::size_t i = 0; i < items.size(); ++i)
            if (items[i].left == 0) tasks.push_back(i);
        std::sort(tasks.begin(), tasks.end(), [&](std::size_t a, std::size_t b) {
            return items[a].range.size() > items[b].range.size();
        });
        parallel_for(tasks.size(), threads_, [&](std::size_t i) {
            Item& item = items[tasks[i]];
            const Range& r = item.range;
            if (item.in_scratch)
                std::copy(scratch_.data() + r.begin, scratch_.data() + r.end, tree_.refs.data() + r.begin);
            item.costs = build_range(r, item.split);
        });
        for (std::size_t i = items.size(); i-- > 0;) {
            Item& item = items[i];
            if (item.left == 0) continue;
            BinaryNode& node = tree_.nodes[item.split];
            node.left = items[item.left].split;
            node.right = items[item.left + 1].split;
            item.costs = gather_costs(node, item.range.box, items[item.left].costs, items[item.left + 1].costs,
                                      largest_leaf_);
        }
        tree_.root = items[0].split;
        tree_.box = items[0].range.box;
    }

private:
    // Whether SAH may still choose: halving must be able to finish within the depth that is left.
    bool may_choose(const Range& range) const {
        return range.depth + static_cast<int>(std::bit_width(blocks_for(range.size()))) < depth_limit_;
    }

    Range whole_range() {
        std::vector<Range> parts((tree_.count + chunk_size - 1) / chunk_size);
        parallel_chunks(tree_.count, chunk_size, threads_, [&](std::size_t begin, std::size_t end) {
            Range part{};
            for (std::size_t i = begin; i < end; ++i) {
                part.box.grow(tree_.refs[i].box());
                part.centroids.grow(tree_.refs[i].centroid());
            }
            parts[begin / chunk_size] = part;
        });
        Range all{0, tree_.count, 0, {}, {}};
        for (const Range& part : parts) {
            all.box.grow(part.box);
            all.centroids.grow(part.centroids);
        }
        return all;
    }

    std::uint32_t store_node(const Range& range, const Halves& halves) {
        const std::uint32_t split = halves.right.begin;
        BinaryNode& node = tree_.nodes[split];
        for (int k = 0; k < 3; ++k) {
            node.lo[k] = range.box.lo[k];
            node.hi[k] = range.box.hi[k];
        }
        node.begin = range.begin;
        node.end = range.end;
        node.left = node.right = 0;
        node.axis = static_cast<std::uint8_t>(halves.axis);
        return split;
    }

    // Builds the subtree over a range on this thread. `split` is set to its root's place, if it has a node.
    SlotCosts build_range(const Range& range, std::uint32_t& split) {
        if (range.size() <= block_width) return block_costs(range.box);
        const Halves halves = split_alone(range);
        split = store_node(range, halves);
        std::uint32_t left_split = 0, right_split = 0;
        const SlotCosts left = build_range(halves.left, left_split);
        const SlotCosts right = build_range(halves.right, right_split);
        BinaryNode& node = tree_.nodes[split];
        node.left = left_split;
        node.right = right_split;
        return gather_costs(node, range.box, left, right, largest_leaf_);
    }

    static Halves start_halves(const Range& range, std::uint32_t middle, int axis) {
        return {{range.begin, middle, range.depth + 1, {}, {}}, {middle, range.end, range.depth + 1, {}, {}}, axis};
    }

    static int longest_axis(const Range& range) {
        const Float4v extent = range.centroids.hi - range.centroids.lo;
        int axis = 0;
        for (int k = 1; k < 3; ++k)
            if (extent[k] > extent[axis]) axis = k;
        return axis;
    }

    // Halves by number, along the longest axis where centroids differ: always possible, always balanced.
    Halves split_by_number(const Range& range, PrimRef* refs) const {
        const int axis = longest_axis(range);
        const std::uint32_t middle = range.begin + (blocks_for(range.size()) + 1) / 2 * block_width;
        Halves halves = start_halves(range, std::min(middle, range.end - 1), axis);
        std::nth_element(refs + range.begin, refs + halves.right.begin, refs + range.end,
                         [axis](const PrimRef& a, const PrimRef& b) {
                             const float x = a.centroid()[axis], y = b.centroid()[axis];
                             return x < y || (x == y && a.prim() < b.prim());
                         });
        for (Range* half : {&halves.left, &halves.right})
            for (std::uint32_t i = half->begin; i < half->end; ++i) {
                half->box.grow(refs[i].box());
                half->centroids.grow(refs[i].centroid());
            }
        return halves;
    }

    Halves split_alone(const Range& range) const {
        PrimRef* refs = tree_.refs.data();
        if (!may_choose(range)) return split_by_number(range, refs);
        const BinMap bin_of(range);
        Bins bins(bin_of.count);
        bins.add(refs, range.begin, range.end, bin_of);
        const Split split = best_split(bins, bin_of);
        if (split.axis < 0) return split_by_number(range, refs);
        const auto goes_left = [&](Float4v centroid) { return bin_of(centroid, split.axis) < split.bin; };
        Box left, right;  // of the centroids
        std::uint32_t i = range.begin, j = range.end;
        for (;;) {
            for (; i < j && goes_left(refs[i].centroid()); ++i) left.grow(refs[i].centroid());
            for (; i < j && !goes_left(refs[j - 1].centroid()); --j) right.grow(refs[j - 1].centroid());
            if (i == j) break;
            left.grow(refs[j - 1].centroid());
            right.grow(refs[i].centroid());
            std::swap(refs[i++], refs[--j]);
        }
        Halves halves = start_halves(range, i, split.axis);
        halves.left.box = bins.box_of(split.axis, 0, split.bin), halves.left.centroids = left;
        halves.right.box = bins.box_of(split.axis, split.bin, bin_of.count), halves.right.centroids = right;
        return halves;
    }

    // The same over all threads: chunks are binned apart, then copied to the other array, each to places known
    // from the bins. The result depends on the chunks, whose size is fixed, and not on the threads.
    Halves split_together(const Range& range, bool from_scratch) {
        PrimRef* from = from_scratch ? scratch_.data() : tree_.refs.data();
        PrimRef* to = from_scratch ? tree_.refs.data() : scratch_.data();
        const BinMap bin_of(range);
        const std::size_t chunks = (range.size() + chunk_size - 1) / chunk_size;
        std::vector<Bins> parts(chunks, Bins(bin_of.count));
        parallel_chunks(range.size(), chunk_size, threads_, [&](std::size_t begin, std::size_t end) {
            parts[begin / chunk_size].add(from, range.begin + begin, range.begin + end, bin_of);
        });
        Bins bins(bin_of.count);
        for (const Bins& part : parts) bins.add(part, bin_of.count);
        const Split split = may_choose(range) ? best_split(bins, bin_of) : Split{};
        if (split.axis < 0) {
            const Halves halves = split_by_number(range, from);
            std::copy(from + range.begin, from + range.end, to + range.begin);
            return halves;
        }
        const auto lefts = [&](const Bins& part) {
            return std::accumulate(part.count[split.axis], part.count[split.axis] + split.bin, std::uint32_t{0});
        };
        Halves halves = start_halves(range, range.begin + lefts(bins), split.axis);
        std::vector<std::uint32_t> left_begin(chunks), right_begin(chunks);
        std::uint32_t left = halves.left.begin, right = halves.right.begin;
        for (std::size_t i = 0; i < chunks; ++i) {
            left_begin[i] = left;
            right_begin[i] = right;
            const std::uint32_t size = static_cast<std::uint32_t>(std::min(chunk_size, range.size() - i * chunk_size));
            left += lefts(parts[i]);
            right += size - lefts(parts[i]);
        }
        std::vector<std::array<Box, 2>> centroids(chunks);
        parallel_chunks(range.size(), chunk_size, threads_, [&](std::size_t begin, std::size_t end) {
            const std::size_t chunk = begin / chunk_size;
            std::uint32_t next[2] = {left_begin[chunk], right_begin[chunk]};
            for (std::size_t i = range.begin + begin; i < range.begin + end; ++i) {
                const Float4v centroid = from[i].centroid();
                const bool side = bin_of(centroid, split.axis) >= split.bin;
                centroids[chunk][side].grow(centroid);
                to[next[side]++] = from[i];
            }
        });
        for (const auto& part : centroids) {
            halves.left.centroids.grow(part[0]);
            halves.right.centroids.grow(part[1]);
        }
        halves.left.box = bins.box_of(split.axis, 0, split.bin);
        halves.right.box = bins.box_of(split.axis, split.bin, bin_of.count);
        return halves;
    }

    BinaryTree& tree_;
    LargeArray<PrimRef> scratch_;
    unsigned threads_;
    int depth_limit_;
    std::uint32_t largest_leaf_;
};

}  // namespace

BinaryTree build_binary_tree(LargeArray<PrimRef> refs, std::uint32_t count, unsigned threads, int depth_limit,
                             std::uint32_t largest_leaf) {
    BinaryTree tree;
    tree.refs = std::move(refs);
    tree.count = count;
    tree.nodes = LargeArray<BinaryNode>(count);
    if (count > 0) TreeBuilder(tree, threads, depth_limit, largest_leaf).build();
    return tree;
}

}  // namespace wive
