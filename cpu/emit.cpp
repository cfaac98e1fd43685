#include "emit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "collapse.h"
#include "parallel.h"
#include "write_compressed.h"
#include "write_float32.h"

namespace wive {

float plane_below(float plane, float center) {
    const float p = plane - center;
    return static_cast<double>(p) > static_cast<double>(plane) - center ? std::nextafter(p, -std::numeric_limits<float>::infinity()) : p;
}
float plane_above(float plane, float center) {
    const float p = plane - center;
    return static_cast<double>(p) < static_cast<double>(plane) - center ? std::nextafter(p, std::numeric_limits<float>::infinity()) : p;
}

namespace {

constexpr std::uint32_t parallel_subtree = 1 << 14;  // subtrees of at most so many triangles are emitted by one thread

// A leaf's triangles by rising number.
class LeafPrims {
public:
    LeafPrims(const BinaryTree& tree, const Slot& slot) : count_(slot.end - slot.begin) {
        for (std::uint32_t i = 0; i < count_; ++i) prims_[i] = tree.refs[slot.begin + i].prim();
        std::sort(prims_.begin(), prims_.begin() + count_);
    }
    std::span<const std::uint32_t> span() const { return {prims_.data(), count_}; }

private:
    std::array<std::uint32_t, block_width * max_leaf_blocks> prims_;
    std::uint32_t count_;
};

// Plans where everything goes; Writer knows what the nodes and blocks there look like.
template <class Writer>
class Emitter {
    using StoredNode = typename Writer::Node;

public:
    Emitter(const BinaryTree& tree, const Mesh& mesh, const BuildOptions& options, const std::array<float, 3>& center)
        : tree_(tree), mesh_(mesh), options_(options), center_(center) {}

    struct Size {
        std::size_t nodes = 0, leaf_units = 0;
    };

    EmittedTree emit(unsigned threads) {
        // First the top of the tree, which only plans; then each subtree below it, at a place known by its size.
        const Treelet root = gather_root(tree_);
        std::vector<Subtree> subtrees;
        Size top = {1, 0};
        plan_top(root, top, subtrees);
        parallel_for(subtrees.size(), threads, [&](std::size_t i) { subtrees[i].size = measure(subtrees[i].slot); });
        Size total = top;
        for (Subtree& subtree : subtrees) {
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
    struct Subtree {
        Slot slot;
        Size size, first;
        std::size_t node = 0;
        int depth = 0;
    };
    using Children = std::array<std::uint32_t, node_width>;

    static std::uint32_t node_child(std::size_t node) { return inner_child(node * (sizeof(StoredNode) / unit_bytes)); }

    static bool is_top(const Slot& slot) { return !slot.leaf && slot.end - slot.begin > parallel_subtree; }

    void plan_top(const Treelet& treelet, Size& top, std::vector<Subtree>& subtrees) const {
        for (int i = 0; i < treelet.count; ++i) top.nodes += treelet.slots[static_cast<std::size_t>(i)].leaf ? 0 : 1;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& slot = treelet.slots[static_cast<std::size_t>(i)];
            if (is_top(slot))
                plan_top(gather_treelet(tree_, slot.split), top, subtrees);
            else
                subtrees.push_back({slot, {}, {}, 0, 0});
        }
    }

    // Nodes and units of blocks below a slot, without the slot's own node.
    Size measure(const Slot& slot) const {
        if (slot.leaf) return {0, Writer::leaf_size(mesh_, LeafPrims(tree_, slot).span()).units};
        const Treelet treelet = gather_treelet(tree_, slot.split);
        Size size;
        for (int i = 0; i < treelet.count; ++i) {
            const Slot& child = treelet.slots[static_cast<std::size_t>(i)];
            const Size below = measure(child);
            size.nodes += below.nodes + (child.leaf ? 0 : 1);
            size.leaf_units += below.leaf_units;
        }
        return size;
    }

    int emit_top(const Treelet& treelet, std::size_t place, Size& cursor, std::vector<Subtree>& subtrees,
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
                deepest = std::max(deepest, emit_top(gather_treelet(tree_, slot.split), node, cursor, subtrees, next_subtree));
                for (std::size_t k = first; k < next_subtree; ++k) ++subtrees[k].depth;
            } else {
                Subtree& subtree = subtrees[next_subtree++];
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
        const Treelet treelet = gather_treelet(tree_, slot.split);
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
        Box box;
        if (!slot.leaf || slot.end - slot.begin > block_width) {
            const BinaryNode& node = tree_.nodes[slot.split];
            box.lo = Float4v{node.lo[0], node.lo[1], node.lo[2], 0};
            box.hi = Float4v{node.hi[0], node.hi[1], node.hi[2], 0};
            return box;
        }
        for (std::uint32_t i = slot.begin; i < slot.end; ++i) box.grow(tree_.refs[i].box());
        return box;
    }

    void write_node(StoredNode& out, const Treelet& treelet, const Children& children) const {
        Node node;
        for (int i = 0; i < node_width; ++i) {
            const bool used = i < treelet.count;
            const Box box = used ? box_of(treelet.slots[static_cast<std::size_t>(i)]) : Box{};
            for (int axis = 0; axis < 3; ++axis) {
                const float center = center_[static_cast<std::size_t>(axis)];
                node.planes[2 * axis][i] = used ? plane_below(box.lo[axis], center) : empty_plane;
                node.planes[2 * axis + 1][i] = used ? plane_above(box.hi[axis], center) : -empty_plane;
            }
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
        const LeafPrims prims(tree_, slot);
        const std::size_t first = cursor.leaf_units;
        const LeafSize size =
            Writer::write_leaf(mesh_, options_.accuracy, prims.span(), leaves_ + first * unit_bytes);
        cursor.leaf_units += size.units;
        return leaf_child(first_leaf_unit_ + first, size.blocks);
    }

    // Larger than any plane with its slack, small enough that no arithmetic on it overflows.
    static constexpr float empty_plane = 1e24f;

    const BinaryTree& tree_;
    const Mesh& mesh_;
    const BuildOptions& options_;
    const std::array<float, 3>& center_;
    StoredNode* nodes_ = nullptr;
    std::byte* leaves_ = nullptr;
    std::size_t first_leaf_unit_ = 0;
};

}  // namespace

EmittedTree emit_tree(const BinaryTree& tree, const Mesh& mesh, const BuildOptions& options,
                      const std::array<float, 3>& center, unsigned threads) {
    if (options.nodes == NodeForm::compressed)
        return Emitter<CompressedWriter>(tree, mesh, options, center).emit(threads);
    return Emitter<Float32Writer>(tree, mesh, options, center).emit(threads);
}

}  // namespace wive
