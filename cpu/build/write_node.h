// Writes boxes and triangles to uncompressed nodes and blocks, for building and refitting.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>

#include "build/mesh.h"
#include "core/box.h"
#include "core/layout.h"
#include "core/planes.h"

namespace wive {

// A plane of an empty lane: larger than any box's plane with its slack, small enough that no arithmetic on it
// overflows.
inline constexpr float empty_plane = 1e24f;

// How far a box's planes are moved outwards, per largest |plane| of that box: at least 16u are needed for the rounding
// of distances to them (traverse/frame.h), and u for the rounding of the moved plane. Rounding is monotonic, so a box
// inside another stays inside.
inline constexpr float plane_slack_factor = 0x1.1p-20f;

// Writes a child's box with its slack. An empty one becomes the inverted box that nothing hits.
inline void write_box(Node& node, int lane, const Box& box, const std::array<float, 3>& center) {
    const bool empty = !(box.lo[0] <= box.hi[0]);
    float low[3], high[3], largest = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const float c = center[static_cast<std::size_t>(axis)];
        low[axis] = empty ? empty_plane : plane_below(box.lo[axis], c);
        high[axis] = empty ? -empty_plane : plane_above(box.hi[axis], c);
        assert(std::isfinite(low[axis]) && std::isfinite(high[axis]));  // coordinates are at most max_coordinate
        largest = std::max({largest, -low[axis], high[axis]});
    }
    const float slack = largest * plane_slack_factor;
    for (int axis = 0; axis < 3; ++axis) {
        node.planes[low_row(axis)][lane] = low[axis] - slack;
        node.planes[high_row(axis)][lane] = high[axis] + slack;
    }
}

// Bytes of a block behind its prims.
template <class Real>
inline constexpr std::size_t block_padding =
    sizeof(TriangleBlockOf<Real>) - sizeof TriangleBlockOf<Real>::rows - sizeof TriangleBlockOf<Real>::prim;

// Makes all lanes unused.
template <class Real>
void clear_block(TriangleBlockOf<Real>& block) {
    for (auto& row : block.rows) std::fill(std::begin(row), std::end(row), std::numeric_limits<Real>::quiet_NaN());
    std::fill(std::begin(block.prim), std::end(block.prim), -1);
    if constexpr (block_padding<Real> > 0)
        std::memset(reinterpret_cast<std::byte*>(&block + 1) - block_padding<Real>, 0, block_padding<Real>);
}

// Makes the lane unused if the triangle is out of range.
template <class Real>
void write_triangle(TriangleBlockOf<Real>& block, std::uint32_t lane, const Mesh<Real>& mesh, std::uint32_t prim,
                    Accuracy accuracy) {
    Real corners[3][3];
    const bool in_range = mesh.load_corners(prim, corners);
    for (int k = 0; k < 3; ++k) {
        const bool edge = accuracy == Accuracy::fast && k > 0;
        for (int axis = 0; axis < 3; ++axis)
            block.rows[triangle_row(k, axis)][lane] = edge ? corners[k][axis] - corners[0][axis] : corners[k][axis];
    }
    block.prim[lane] = static_cast<std::int32_t>(prim);
    if (in_range) [[likely]]
        return;
    for (auto& row : block.rows) row[lane] = std::numeric_limits<Real>::quiet_NaN();
    block.prim[lane] = -1;
}

}  // namespace wive
