// Writes a leaf of an uncompressed tree again, over moved vertices.
#pragma once

#include <cstddef>
#include <cstdint>

#include "build/mesh.h"
#include "build/write_node.h"
#include "core/box.h"
#include "core/layout.h"

namespace wive {

// Writes the triangles of `old` blocks that still have an area to `to`, which may be `old`, and calls lost(prim) for
// the others. Returns the box of those written, as box_triangle makes it.
template <class Real, class Lost>
Box refit_leaf(const TriangleBlockOf<Real>* old, TriangleBlockOf<Real>* to, std::uint32_t blocks,
               const Mesh<Real>& mesh, const Point& center, Accuracy accuracy, const Lost& lost) {
    Box all;
    for (std::uint32_t i = 0; i < blocks; ++i) {
        std::int32_t prims[block_width];
        std::copy(std::begin(old[i].prim), std::end(old[i].prim), prims);
        clear_block(to[i]);
        for (std::uint32_t lane = 0; lane < block_width; ++lane) {
            if (prims[lane] < 0) continue;
            const auto prim = static_cast<std::uint32_t>(prims[lane]);
            Box box;
            if (!box_triangle(mesh, center, prim, box)) {
                lost(prim);
                continue;
            }
            write_triangle(to[i], lane, mesh, prim, accuracy);
            all.grow(box);
        }
    }
    return all;
}

}  // namespace wive
