// Writing compressed nodes and blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "compressed.h"
#include "layout.h"
#include "mesh.h"

namespace wive {

struct CompressedWriter {
    using Node = CompressedNode;
    using Block = CompressedBlock;

    // Every box of `out` holds that of `node`, in exact arithmetic. children: how many lanes are used.
    static void write_node(const wive::Node& node, int children, Node& out);
    static std::size_t count_blocks(const Mesh& mesh, std::span<const std::uint32_t> prims);
    // Returns how many blocks it wrote. Blocks of both accuracies are the same.
    static std::size_t write_blocks(const Mesh& mesh, Accuracy, std::span<const std::uint32_t> prims, Block* out);
};

}  // namespace wive
