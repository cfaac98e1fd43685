// The binary tree that wide nodes are gathered from.
#pragma once

#include <array>
#include <cstdint>

#include "box.h"
#include "large_array.h"
#include "layout.h"
#include "mesh.h"

namespace wive {

// Surface area cost, in units of one node visit or one triangle block test; Embree's measure.
inline constexpr float node_cost = 1.0f;
inline constexpr float block_cost = 1.0f;

constexpr std::uint32_t blocks_for(std::uint32_t prims) { return (prims + block_width - 1) / block_width; }

// An inner node over the references [begin, end). It is stored at index `split`, where its right side begins:
// every inner node has a split position of its own, so threads never contend for a place and the tree does not
// depend on them. Ranges of at most block_width references are leaves and have no node.
struct alignas(64) BinaryNode {
    float lo[3], hi[3];
    std::uint32_t begin, end;
    std::uint32_t left, right;  // the children's own split positions
    std::uint8_t axis;
    // How to gather this subtree into i slots of a wide node (dynamic programme, see collapse.h): the left
    // child gets share[i] of them; 0 says that i - 1 slots do as well. share[1]: 1 where one leaf is cheapest,
    // 0 where a wide node is; share[0]: the left child's part of that wide node's eight slots.
    std::uint8_t share[node_width + 1];
};
static_assert(sizeof(BinaryNode) == 64);

struct BinaryTree {
    LargeArray<PrimRef> refs;  // in leaf order
    std::uint32_t count = 0;
    LargeArray<BinaryNode> nodes;
    std::uint32_t root = 0;  // split position; no node where count <= block_width
    Box box;
};

// Binned SAH, leaf cost counted in blocks of four. The same tree whatever the number of threads. At most depth_limit
// levels deep: where the rest could be too deep, ranges are halved by number, which bit_width(blocks) levels finish. Leaves of
// at most largest_leaf blocks of four triangles.
BinaryTree build_binary_tree(LargeArray<PrimRef> refs, std::uint32_t count, unsigned threads, int depth_limit,
                             std::uint32_t largest_leaf);

}  // namespace wive
