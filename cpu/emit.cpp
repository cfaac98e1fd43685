#include "emit.h"

#include <algorithm>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "collapse.h"
#include "parallel.h"
#include "write_compressed.h"
#include "write_float32.h"
#include "write_node.h"

namespace wive {

namespace {

// Subtrees that one thread emits: about so many, of so many triangles at most and at least.
constexpr std::uint32_t subtree_count = 64, largest_subtree = 1 << 14, smallest_subtree = 1 << 10;

// A leaf's triangles by rising number.
class LeafPrims {
public:
    LeafPrims(const BinaryTree& tree, const Subtree& leaf) : count_(leaf.size()) {
        for (std::uint32_t i = 0; i < count_; ++i) prims_[i] = tree.refs[leaf.begin + i].prim();
        std::sort(prims_.begin(), prims_.begin() + count_);
    }
    std::span<const std::uint32_t> span() const { return {prims_.data(), count_}; }

private:
    std::array<std::uint32_t, block_width * max_leaf_blocks> prims_;
    std::uint32_t count_;
};

// Plans where everything goes; Writer knows what the nodes and blocks there look like.
template <class Writer, class Real>
class Emitter {
    using StoredNode = typename Writer::Node;

public:
    Emitter(const BinaryTree& tree, const Mesh<Real>& mesh, const BuildOptions& options, const std::array<float, 3>& center)
        : tree_(tree), mesh_(mesh), options_(options), center_(center) {}

    using Size = TreeSize;

    EmittedTree emit(Threads& threads) {
        // First the top of the tree, which only plans; then each subtree below it, at a place known by its size.
        const Treelet root = gather_root(tree_);
        std::vector<Part> subtrees;
        Size top = {1, 0};
        plan_top(root, top, subtrees);
        parallel_for(subtrees.size(), threads, [&](std::size_t i) { subtrees[i].size = size_of(subtrees[i].slot); });
        Size total = top;
        for (Part& subtree : subtrees) {
            subtree.first = total;
            total.nodes += subtree.size.nodes;
            total.leaf_units += subtree.size.leaf_units;
        }
        const std::size_t node_bytes = total.nodes * sizeof(StoredNode);
        const std::size_t bytes = node_bytes + total.leaf_units * unit_bytes;
        if (bytes / unit_bytes > max_units) throw std::invalid_argument("faces: too many triangles for one scene");
        LargeArray<std::byte> units(bytes);
        nodes_ = reinterpret_cast<StoredNode*>(units.data());
        leaves_ = units.data() + node_bytes;
        first_leaf_unit_ = node_bytes / unit_bytes;
        Size cursor = {1, 0};
        std::size_t next_subtree = 0;
        int depth = emit_top(root, 0, cursor, subtrees, next_subtree);
        std::vector<int> depths(subtrees.size());
        parallel_for(subtrees.size(), threads, [&](std::size_t i) {
            Size at = subtrees[i].first;
            if (!subtrees[i].slot.leaf) depths[i] = emit_subtree(subtrees[i].slot, subtrees[i].node, at);
        });
        for (std::size_t i = 0; i < subtrees.size(); ++i) depth = std::max(depth, subtrees[i].depth + depths[i]);
        return {std::move(units), total.nodes, depth};
    }

private:
    // A slot whose whole content one thread emits; its own node's place was given by its parent.
    struct Part {
        Slot slot;
        Size size, first;
        std::size_t node = 0;
        int depth = 0;
    };
    using Children = std::array<std::uint32_t, node_width>;

    static std::uint32_t node_child(std::size_t node) { return inner_child(node * (sizeof(StoredNode) / unit_bytes)); }

    bool is_top(const Slot& slot) const { return !slot.leaf && slot.tree.size() > subtree_size_; }

    void plan_top(const Treelet& treelet, Size& top, std::vector<Part>& subtrees) const {
        for (int i = 0; i < treelet.count; ++i) top.nodes += treelet.slots[static_cast<std::size_t>(i)].leaf ? 0 : 1;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& slot = treelet.slots[static_cast<std::size_t>(i)];
            if (is_top(slot))
                plan_top(gather_treelet(tree_, slot.tree), top, subtrees);
            else
                subtrees.push_back({slot, {}, {}, 0, 0});
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

    int emit_top(const Treelet& treelet, std::size_t place, Size& cursor, std::vector<Part>& subtrees,
                 std::size_t& next_subtree) {
        std::size_t child_node = cursor.nodes;
        for (int i = 0; i < treelet.count; ++i) cursor.nodes += treelet.slots[static_cast<std::size_t>(i)].leaf ? 0 : 1;
        Children children{};
        int deepest = 0;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& slot = treelet.slots[static_cast<std::size_t>(i)];
            const std::size_t node = slot.leaf ? 0 : child_node++;
            if (is_top(slot)) {
                children[static_cast<std::size_t>(i)] = node_child(node);
                const std::size_t first = next_subtree;
                deepest = std::max(deepest, emit_top(gather_treelet(tree_, slot.tree), node, cursor, subtrees, next_subtree));
                for (std::size_t k = first; k < next_subtree; ++k) ++subtrees[k].depth;
            } else {
                Part& subtree = subtrees[next_subtree++];
                subtree.node = node;
                subtree.depth = 1;
                Size at = subtree.first;
                children[static_cast<std::size_t>(i)] = slot.leaf ? write_leaf(slot, at) : node_child(node);
            }
        }
        write_node(nodes_[place], treelet, children);
        return deepest + 1;
    }

    // Returns the depth of the subtree, its root counted.
    int emit_subtree(const Slot& slot, std::size_t place, Size& cursor) {
        const Treelet treelet = gather_treelet(tree_, slot.tree);
        Children children{};
        std::size_t child_node = cursor.nodes;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& child = treelet.slots[static_cast<std::size_t>(i)];
            children[static_cast<std::size_t>(i)] = child.leaf ? write_leaf(child, cursor) : node_child(cursor.nodes++);
        }
        write_node(nodes_[place], treelet, children);
        int deepest = 0;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& child = treelet.slots[static_cast<std::size_t>(i)];
            if (!child.leaf) deepest = std::max(deepest, emit_subtree(child, child_node++, cursor));
        }
        return deepest + 1;
    }

    Box box_of(const Slot& slot) const {
        if (slot.tree.has_node()) return tree_.box_of(slot.tree);
        Box box;
        for (std::uint32_t i = slot.tree.begin; i < slot.tree.end; ++i) box.grow(tree_.refs[i].box());
        return box;
    }

    void write_node(StoredNode& out, const Treelet& treelet, const Children& children) const {
        Node node;
        for (int i = 0; i < node_width; ++i) {
            write_box(node, i, i < treelet.count ? box_of(treelet.slots[static_cast<std::size_t>(i)]) : Box{}, center_);
            node.child[i] = children[static_cast<std::size_t>(i)];
        }
        const SlotSequences order = options_.order == ChildOrder::treelet    ? treelet.order
                                    : options_.order == ChildOrder::diagonal ? sort_along_diagonals(node, treelet.count)
                                    : options_.order == ChildOrder::slots    ? assign_places(node, treelet.count)
                                                                             : shuffle(node, treelet.count);
        write_order(node, order, treelet.count);
        Writer::write_node(node, treelet.count, out);
    }

    std::uint32_t write_leaf(const Slot& slot, Size& cursor) const {
        const LeafPrims prims(tree_, slot.tree);
        const std::size_t first = cursor.leaf_units;
        const LeafSize size =
            Writer::write_leaf(mesh_, options_.accuracy, prims.span(), leaves_ + first * unit_bytes);
        cursor.leaf_units += size.units;
        return leaf_child(first_leaf_unit_ + first, size.blocks);
    }

    const BinaryTree& tree_;
    const Mesh<Real>& mesh_;
    const BuildOptions& options_;
    const std::array<float, 3>& center_;
    std::uint32_t subtree_size_ = std::clamp(tree_.count / subtree_count, smallest_subtree, largest_subtree);
    StoredNode* nodes_ = nullptr;
    std::byte* leaves_ = nullptr;
    std::size_t first_leaf_unit_ = 0;
};

}  // namespace

template <class Real>
EmittedTree emit_tree(const BinaryTree& tree, const Mesh<Real>& mesh, const BuildOptions& options,
                      const std::array<float, 3>& center, Threads& threads) {
    using Compressed = std::conditional_t<precision_of<Real> == Precision::float32, CompressedWriter, CompressedFloat64Writer>;
    if (options.nodes == NodeForm::compressed)
        return Emitter<Compressed, Real>(tree, mesh, options, center).emit(threads);
    return Emitter<Float32Writer<Real>, Real>(tree, mesh, options, center).emit(threads);
}

template EmittedTree emit_tree(const BinaryTree&, const Mesh<float>&, const BuildOptions&, const std::array<float, 3>&, Threads&);
template EmittedTree emit_tree(const BinaryTree&, const Mesh<double>&, const BuildOptions&, const std::array<float, 3>&, Threads&);

}  // namespace wive
