// Writes compressed nodes and blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "build/emit.h"
#include "build/mesh.h"
#include "build/write_float32.h"
#include "core/compressed.h"
#include "core/layout.h"

namespace wive {

struct CompressedWriter {
    using Node = CompressedNode;
    using Block = CompressedBlock;

    // Every box of `out` contains that of `node`, in exact arithmetic, and slack for the rounding of its own planes.
    // children: the number of lanes used.
    static void write_node(const wive::Node& node, int children, Node& out);
    // The size of a leaf over these prims, at most max_compressed_leaf of them.
    static LeafSize leaf_size(const Mesh<float>& mesh, std::span<const std::uint32_t> prims);
    // Writes the leaf and returns its size. The bytes do not depend on the accuracy: blocks hold vertices for all
    // three.
    static LeafSize write_leaf(const Mesh<float>& mesh, Accuracy, std::span<const std::uint32_t> prims,
                               std::span<std::byte> out);
};

// Compressed nodes over blocks of doubles.
struct CompressedFloat64Writer : Float32Writer<double> {
    using Node = CompressedNode;

    static void write_node(const wive::Node& node, int children, Node& out) {
        CompressedWriter::write_node(node, children, out);
    }
};

}  // namespace wive
