// Writing uncompressed nodes and blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "binary_tree.h"
#include "builder.h"
#include "emit.h"
#include "layout.h"
#include "mesh.h"

namespace wive {

struct Float32Writer {
    using Node = wive::Node;
    using Block = TriangleBlock;

    static void write_node(const wive::Node& node, int, Node& out) { out = node; }
    static LeafSize leaf_size(const Mesh&, std::span<const std::uint32_t> prims) {
        const std::uint32_t blocks = blocks_for(static_cast<std::uint32_t>(prims.size()));
        return {blocks * (sizeof(Block) / unit_bytes), blocks};
    }
    static LeafSize write_leaf(const Mesh& mesh, Accuracy accuracy, std::span<const std::uint32_t> prims, std::byte* out);
};

}  // namespace wive
