// How boxes and triangles are stored in a tree: used when it is built and when it is refitted.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "box.h"
#include "layout.h"
#include "mesh.h"

namespace wive {

// Larger than any plane with its slack, small enough that no arithmetic on it overflows.
inline constexpr float empty_plane = 1e24f;

// Planes relative to the centre, rounded outwards so that a box never shrinks.
inline float plane_below(float plane, float center) {
    const float p = plane - center;
    const bool above = static_cast<double>(p) > static_cast<double>(plane) - center;
    return above ? std::nextafter(p, -std::numeric_limits<float>::infinity()) : p;
}
inline float plane_above(float plane, float center) { return -plane_below(-plane, -center); }

// A child's box; an empty one becomes a box that nothing hits.
inline void write_box(Node& node, int lane, const Box& box, const std::array<float, 3>& center) {
    const bool empty = !(box.lo[0] <= box.hi[0]);
    for (int axis = 0; axis < 3; ++axis) {
        const float c = center[static_cast<std::size_t>(axis)];
        node.planes[2 * axis][lane] = empty ? empty_plane : plane_below(box.lo[axis], c);
        node.planes[2 * axis + 1][lane] = empty ? -empty_plane : plane_above(box.hi[axis], c);
    }
}

inline void clear_block(TriangleBlock& block) {
    for (auto& row : block.rows) std::fill(std::begin(row), std::end(row), std::numeric_limits<float>::quiet_NaN());
    std::fill(std::begin(block.prim), std::end(block.prim), -1);
}

inline void write_triangle(TriangleBlock& block, std::uint32_t lane, const Mesh& mesh, std::uint32_t prim,
                           Accuracy accuracy) {
    const float* first = mesh.corner(prim, 0);
    for (int k = 0; k < 3; ++k) {
        const float* corner = mesh.corner(prim, k);
        const bool edge = accuracy == Accuracy::fast && k > 0;
        for (int axis = 0; axis < 3; ++axis)
            block.rows[3 * k + axis][lane] = edge ? corner[axis] - first[axis] : corner[axis];
    }
    block.prim[lane] = static_cast<std::int32_t>(prim);
}

}  // namespace wive
