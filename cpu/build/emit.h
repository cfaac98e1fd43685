// Writing the tree that was decided: wide nodes and triangle blocks.
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

// What a leaf takes, the units being those of unit_bytes.
struct LeafSize {
    std::size_t units;
    std::uint32_t blocks;
};

// Children of a node stand side by side, then subtree after subtree; the same on any number of threads. Throws
// std::invalid_argument where the tree is larger than child references reach. center: what the tree's boxes are still
// to be made relative to.
template <class Real>
EmittedTree emit_tree(const BinaryTree& tree, const Mesh<Real>& mesh, const BuildOptions& options,
                      const std::array<float, 3>& center, Threads& threads);

}  // namespace wive
