#include "build/verify.h"

#include <atomic>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "build/write_node.h"
#include "core/compressed.h"
#include "core/parallel.h"

namespace wive {
namespace {

constexpr std::size_t chunk_size = 1 << 10;

[[noreturn]] void refuse(const std::string& fault) { throw std::invalid_argument(fault); }

void expect_in(bool holds, const char* what, std::size_t number, const char* fault) {
    if (!holds) [[unlikely]]
        refuse(what + std::string(" ") + std::to_string(number) + ": " + fault);
}

// A node's slot that comes i-th from front to back, of all octants.
std::uint32_t order_word(const Node& node, int i) { return node.order[i]; }
std::uint32_t order_word(const CompressedNode& node, int i) {
    const std::uint8_t* bytes = node.order[i];
    return bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8 | static_cast<std::uint32_t>(bytes[2]) << 16;
}
constexpr int bits_of_order(const Node&) { return order_bits; }
constexpr int bits_of_order(const CompressedNode&) { return CompressedNode::order_bits; }

// Every slot comes once in each octant; a slot that came twice could double the visits on every level.
template <class StoredNode>
bool has_permutations(const StoredNode& node) {
    const int bits = bits_of_order(node);
    for (int octant = 0; octant < octants; ++octant) {
        unsigned seen = 0;
        for (int i = 0; i < node_width; ++i) seen |= 1u << (order_word(node, i) >> bits * octant & ((1u << bits) - 1));
        if (seen != (1u << node_width) - 1) return false;
    }
    return true;
}

// Finite planes; in float32 nodes, a lane without a child has the box that nothing hits.
bool has_good_planes(const Node& node) {
    bool good = true;
    for (int lane = 0; lane < node_width; ++lane)
        for (int axis = 0; axis < 3; ++axis) {
            const float low = node.planes[low_row(axis)][lane], high = node.planes[high_row(axis)][lane];
            const bool is_empty = low >= 0.5f * empty_plane && high <= -0.5f * empty_plane;
            good &= std::abs(low) <= 2 * empty_plane && std::abs(high) <= 2 * empty_plane;
            good &= node.child[lane] != end_of_stack || is_empty;
        }
    return good;
}
bool has_good_planes(const CompressedNode& node) {
    bool good = true;
    for (int axis = 0; axis < 3; ++axis)
        good &= std::abs(node.origin[axis]) <= empty_plane && node.step[axis] >= 0 && node.step[axis] <= empty_plane;
    return good;
}

// The largest number in a block that is allowed. Fast trees hold edges, up to twice as long as a coordinate, rounded.
template <class Real, class Block>
constexpr Real largest_number(Accuracy accuracy) {
    const bool has_edges = accuracy == Accuracy::fast && !std::is_same_v<Block, CompressedBlock>;
    return (has_edges ? 4 : 1) * max_coordinate<Real>;
}

bool is_prim(std::int32_t prim, std::size_t faces) { return prim >= 0 && static_cast<std::size_t>(prim) < faces; }

// The number of triangles of a block, or -1 if it is wrong.
template <class Real>
int triangles_of(const TriangleBlockOf<Real>& block, std::size_t faces, Real largest) {
    int count = 0;
    bool good = true;
    for (int lane = 0; lane < block_width; ++lane) {
        const bool used = block.prim[lane] != -1;
        for (const auto& row : block.rows) good &= used ? std::abs(row[lane]) <= largest : std::isnan(row[lane]);
        good &= !used || is_prim(block.prim[lane], faces);
        count += used;
    }
    return good ? count : -1;
}
int triangles_of(const CompressedBlock& block, std::size_t faces, float largest) {
    int count = 0;
    bool good = true;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (std::uint32_t i = 0; i < block.vertices(); ++i) good &= std::abs(block.row(axis)[i]) <= largest;
    for (int lane = 0; lane < block_width; ++lane) {
        const bool used = block.used() >> lane & 1u;
        for (int k = 0; k < 3; ++k) {
            const std::uint32_t corner =
                block.corners[CompressedBlock::corner_word(k)] >> CompressedBlock::corner_shift(k, lane) &
                ((1u << CompressedBlock::corner_bits) - 1);
            good &= corner < block.vertices();
        }
        good &= used ? is_prim(block.prim_at(lane), faces) : block.prim_at(lane) == -1;
        count += used;
    }
    return good ? count : -1;
}

// The units of a block whose first unit is within the tree; 0 if that is no block.
template <class Real>
std::size_t units_of(const TriangleBlockOf<Real>&) {
    return TriangleBlockOf<Real>::units();
}
std::size_t units_of(const CompressedBlock& block) {
    const std::uint32_t vertices = block.vertices();
    const bool good = vertices == CompressedBlock::few_vertices || vertices == CompressedBlock::most_vertices;
    return good ? CompressedBlock::units(vertices) : 0;
}

template <class T>
void set(T& place, T value) {
    __atomic_store_n(&place, value, __ATOMIC_RELAXED);
}

// One pass over the nodes and the leaves below them, on all threads. Threads write what they find of a node or a unit
// to its own place. If every place is written, and there are as many references as places, none is referenced twice.
template <class Real, class StoredNode, class Block>
class Verifier {
    static constexpr std::size_t node_units = sizeof(StoredNode) / unit_bytes;

public:
    Verifier(const Bvh& bvh, std::size_t faces)
        : units_(bvh.view().units),
          faces_(faces),
          largest_(largest_number<Real, Block>(bvh.accuracy())),
          node_count_(bvh.nodes().size() / sizeof(StoredNode)),
          unit_count_(bvh.bytes() / unit_bytes),
          parents_(node_count_, no_parent),
          is_in_leaf_(unit_count_ - node_units * node_count_) {}

    void verify(Threads& threads) {
        parallel_chunks(node_count_, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
            Found found;
            for (std::size_t i = begin; i < end; ++i) verify_node(i, found);
            triangles_ += found.triangles;
            children_ += found.children;
            leaf_units_ += found.leaf_units;
        });
        if (children_ + 1 != node_count_ || leaf_units_ != is_in_leaf_.size()) refuse("wrong number of references");
        for (std::size_t i = 1; i < node_count_; ++i)
            expect_in(parents_[i] != no_parent, "node", i, "expected to be one node's child");
        for (std::size_t i = 0; i < is_in_leaf_.size(); ++i)
            expect_in(is_in_leaf_[i] != 0, "unit", node_units * node_count_ + i, "expected to be in one leaf");
    }

    // The number of levels; at most max_depth, or it is refused.
    int depth() const {
        std::vector<std::uint8_t> levels(node_count_, 1);
        int deepest = 1;
        for (std::size_t i = 1; i < node_count_; ++i) {
            const int level = levels[parents_[i]] + 1;  // a parent comes before its children
            expect_in(level <= max_depth, "node", i, "expected a tree of at most 64 levels");
            levels[i] = static_cast<std::uint8_t>(level);
            deepest = std::max(deepest, level);
        }
        return deepest;
    }
    std::size_t triangles() const { return triangles_; }

private:
    static constexpr std::uint32_t no_parent = ~0u;

    struct Found {
        std::size_t triangles = 0, children = 0, leaf_units = 0;
    };

    void verify_node(std::size_t i, Found& found) {
        const StoredNode& node = reinterpret_cast<const StoredNode*>(units_)[i];
        expect_in(has_good_planes(node), "node", i, "expected finite planes, and none in lanes without a child");
        expect_in(has_permutations(node), "node", i, "expected an order row of permutations");
        for (const std::uint32_t child : node.child)
            if (is_inner(child))
                verify_inner(i, child, found);
            else if (child != end_of_stack)
                verify_leaf(i, child, found);
    }

    void verify_inner(std::size_t parent, std::uint32_t child, Found& found) {
        const std::size_t unit = child >> unit_shift, place = unit / node_units;
        expect_in((child & block_count_mask) == 0 && unit % node_units == 0 && parent < place && place < node_count_,
                  "node", parent, "expected children that are nodes behind it");
        set(parents_[place], static_cast<std::uint32_t>(parent));
        ++found.children;
    }

    void verify_leaf(std::size_t parent, std::uint32_t leaf, Found& found) {
        const std::size_t first = node_units * node_count_;
        std::size_t unit = child_offset(leaf) / unit_bytes;
        expect_in(unit >= first, "node", parent, "expected leaves behind the nodes");
        for (std::uint32_t i = 0; i < leaf_block_count(leaf); ++i) {
            expect_in(unit < unit_count_, "node", parent, "expected leaves within the tree");
            const Block& block = *reinterpret_cast<const Block*>(units_ + unit * unit_bytes);
            const std::size_t size = units_of(block);
            expect_in(size > 0 && size <= unit_count_ - unit, "unit", unit, "expected a block within the tree");
            const int triangles = triangles_of(block, faces_, largest_);
            expect_in(triangles >= 0, "unit", unit, "expected a block of finite corners and of triangles of the mesh");
            for (std::size_t k = 0; k < size; ++k) set(is_in_leaf_[unit + k - first], std::uint8_t{1});
            found.triangles += static_cast<std::size_t>(triangles);
            found.leaf_units += size;
            unit += size;
        }
    }

    const std::byte* units_;
    std::size_t faces_;
    Real largest_;
    std::size_t node_count_, unit_count_;
    std::vector<std::uint32_t> parents_;    // of each node
    std::vector<std::uint8_t> is_in_leaf_;  // of each unit behind the nodes
    std::atomic<std::size_t> triangles_ = 0, children_ = 0, leaf_units_ = 0;
};

template <class Real, class StoredNode, class Block>
void verify_form(const Bvh& bvh, std::size_t faces, Threads& threads) {
    Verifier<Real, StoredNode, Block> verifier(bvh, faces);
    verifier.verify(threads);
    if (verifier.depth() != bvh.depth()) refuse("wrong depth");
    if (verifier.triangles() != bvh.facts().triangle_count) refuse("wrong number of triangles");
}

// Finite numbers of which box sizes and distances can be computed. The bounds of no triangle are inverted.
void verify_frame(const TreeFacts& facts) {
    const bool empty = facts.triangle_count == 0;
    bool good = facts.far_away >= 0 && (empty || std::isfinite(facts.far_away));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        constexpr float most = 2 * max_coordinate<float>;
        good &= std::abs(facts.center[axis]) <= most && facts.extent[axis] >= 0 && facts.extent[axis] <= 2 * most;
        const double low = facts.bounds[0][axis], high = facts.bounds[1][axis];
        good &= low <= high ? std::abs(low) <= most && std::abs(high) <= most : empty;
    }
    if (!good) refuse("wrong bounds");
}

}  // namespace

template <class Real>
void verify_tree(const Bvh& bvh, const Mesh<Real>& mesh, Threads& threads) {
    verify_frame(bvh.facts());
    check_mesh(mesh, threads);
    using PlainBlock = TriangleBlockOf<Real>;
    using SmallBlock = std::conditional_t<precision_of<Real> == Precision::float32, CompressedBlock, PlainBlock>;
    if (bvh.node_form() == NodeForm::float32)
        verify_form<Real, Node, PlainBlock>(bvh, mesh.face_count, threads);
    else
        verify_form<Real, CompressedNode, SmallBlock>(bvh, mesh.face_count, threads);
}

template void verify_tree(const Bvh&, const Mesh<float>&, Threads&);
template void verify_tree(const Bvh&, const Mesh<double>&, Threads&);

}  // namespace wive
