// Writes uncompressed nodes and blocks. Blocks of doubles are never compressed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "build/binary_tree.h"
#include "build/builder.h"
#include "build/emit.h"
#include "build/mesh.h"
#include "core/layout.h"

namespace wive {

template <class Real>
struct Float32Writer {
    using Node = wive::Node;
    using Block = TriangleBlockOf<Real>;

    static void write_node(const wive::Node& node, int, Node& out) { out = node; }
    static constexpr std::size_t leaf_units(std::uint32_t triangles) { return blocks_for(triangles) * Block::units(); }
    static LeafSize write_leaf(const Mesh<Real>& mesh, Accuracy accuracy, std::span<const std::uint32_t> prims,
                               std::span<std::byte> out);
};

}  // namespace wive
