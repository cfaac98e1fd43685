// The binary tree that wide nodes are gathered from.
#pragma once

#include <bit>
#include <cstdint>

#include "build/mesh.h"
#include "core/box.h"
#include "core/large_array.h"
#include "core/layout.h"
#include "core/parallel.h"

namespace wive {

// Surface area cost, in units of one node visit or one triangle block test; Embree's measure.
inline constexpr float node_cost = 1.0f;
inline constexpr float block_cost = 1.0f;

constexpr std::uint32_t blocks_for(std::uint32_t prims) { return (prims + block_width - 1) / block_width; }

// How to gather a subtree into slots of a wide node (see collapse.h), and the axis it was split on.
class Choices {
public:
    Choices() = default;
    constexpr Choices(std::uint32_t shares, std::uint32_t wide_share, int axis)
        : bits_(shares | wide_share << 24 | static_cast<std::uint32_t>(axis) << 27) {}

    // Of i slots, 2 to 8, the left child gets so many; 0 says that i - 1 slots do as well.
    constexpr int share(int i) const { return static_cast<int>(bits_ >> 3 * (i - 1) & 7u); }
    // In one slot: whether one leaf is cheapest, else a wide node is.
    constexpr bool as_leaf() const { return (bits_ & 7u) != 0; }
    // The left child's part of that wide node's eight slots.
    constexpr int wide_share() const { return static_cast<int>(bits_ >> 24 & 7u); }
    constexpr int axis() const { return static_cast<int>(bits_ >> 27); }

private:
    std::uint32_t bits_ = 0;  // share(i) in bits 3 * (i - 1)
};

// An inner node over the references [begin, end), which its parent knows. Ranges of at most block_width references
// are leaves and have no node.
struct alignas(16) BinaryNode {
    float lo[3];
    std::uint32_t split;  // where the right side begins
    float hi[3];
    Choices choices;
};
static_assert(sizeof(BinaryNode) == sizeof(PrimRef));

// A subtree: its references, and the place of its node, if it has one. A left child's node stands at its last
// reference's place, a right child's at its first's. No two nodes share a place then (Karras 2012, "Maximizing
// Parallelism in the Construction of BVHs, Octrees, and k-d Trees"), so threads need no locks and the tree does not
// depend on them.
struct Subtree {
    std::uint32_t begin, end, place;

    std::uint32_t size() const { return end - begin; }
    bool has_node() const { return size() > block_width; }
    Subtree left(std::uint32_t split) const { return {begin, split, split - 1}; }
    Subtree right(std::uint32_t split) const { return {split, end, split}; }
};

struct BinaryTree {
    LargeArray<PrimRef> refs;   // in leaf order
    LargeArray<PrimRef> nodes;  // in the memory that references were sorted in; read by node()
    std::uint32_t count = 0;
    std::uint32_t largest_leaf = max_leaf_blocks;  // in blocks of four triangles
    Box box;

    Subtree root() const { return {0, count, 0}; }
    BinaryNode node(const Subtree& tree) const { return std::bit_cast<BinaryNode>(nodes[tree.place]); }
    Box box_of(const Subtree& tree) const {
        if (tree.has_node()) return nodes[tree.place].box();
        Box box;
        for (std::uint32_t i = tree.begin; i < tree.end; ++i) box.grow(refs[i].box());
        return box;
    }
};

// Binned SAH, leaf cost counted in blocks of four. The same tree whatever the number of threads. At most depth_limit
// levels deep: where the rest could be too deep, ranges are halved by number, which bit_width(blocks) levels finish.
// box and centroids: of all references.
BinaryTree build_binary_tree(PrimRefs refs, Threads& threads, int depth_limit, std::uint32_t largest_leaf);

}  // namespace wive
