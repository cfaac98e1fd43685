// Writing uncompressed nodes and blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "binary_tree.h"
#include "builder.h"
#include "layout.h"
#include "mesh.h"

namespace wive {

struct Float32Writer {
    using Node = wive::Node;
    using Block = TriangleBlock;

    static void write_node(const wive::Node& node, int, Node& out) { out = node; }
    static std::size_t count_blocks(const Mesh&, std::span<const std::uint32_t> prims) {
        return blocks_for(static_cast<std::uint32_t>(prims.size()));
    }
    // Returns how many blocks it wrote.
    static std::size_t write_blocks(const Mesh& mesh, Accuracy accuracy, std::span<const std::uint32_t> prims, Block* out);
};

}  // namespace wive
