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
        std::uint32_t prims[block_width];
        bool has_area[block_width];
        for (std::uint32_t lane = 0; lane < block_width; ++lane) {
            const bool is_used = old[i].prim[lane] >= 0;
            prims[lane] = static_cast<std::uint32_t>(old[i].prim[lane]);
            Box box;
            has_area[lane] = is_used && box_triangle(mesh, center, prims[lane], box);
            if (has_area[lane])
                all.grow(box);
            else if (is_used)
                lost(prims[lane]);
        }
        if (has_area[0] && has_area[1] && has_area[2] && has_area[3] && write_full_block(to[i], mesh, prims, accuracy))
            continue;
        clear_block(to[i]);
        for (std::uint32_t lane = 0; lane < block_width; ++lane)
            if (has_area[lane]) write_triangle(to[i], lane, mesh, prims[lane], accuracy);
    }
    return all;
}

}  // namespace wive
