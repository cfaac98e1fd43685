// Writes the collapsed tree to memory: wide nodes and triangle blocks.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "build/binary_tree.h"
#include "build/builder.h"
#include "build/mesh.h"
#include "core/large_array.h"
#include "core/parallel.h"

namespace wive {

struct EmittedTree {
    LargeArray<std::byte> units;
    std::size_t node_count;
    int depth;
};

// The memory that a leaf takes, in units of unit_bytes, and its number of blocks.
struct LeafSize {
    std::size_t units;
    std::uint32_t blocks;
};

// The nodes of a node's children are adjacent; then come the nodes below each child in turn. The same bytes on any
// number of threads. center: the point that planes are made relative to, zero if the tree's boxes already are. Throws
// std::invalid_argument if the tree has more than max_units.
template <class Real>
EmittedTree emit_tree(const BinaryTree& tree, const Mesh<Real>& mesh, const BuildOptions& options,
                      const std::array<float, 3>& center, Threads& threads);

}  // namespace wive
