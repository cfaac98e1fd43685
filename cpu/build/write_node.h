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
    // Lane 3 repeats lane 2: a box's own lane 3 may hold denormals, which are slow.
    Float4v low = __builtin_shufflevector(box.lo, box.lo, 0, 1, 2, 2);
    Float4v high = __builtin_shufflevector(box.hi, box.hi, 0, 1, 2, 2);
    if (empty) {
        low = Float4v{} + empty_plane;
        high = Float4v{} - empty_plane;
    } else if (center != std::array<float, 3>{}) {
        for (int axis = 0; axis < 3; ++axis) {
            const float c = center[static_cast<std::size_t>(axis)];
            low[axis] = plane_below(box.lo[axis], c);
            high[axis] = plane_above(box.hi[axis], c);
        }
    }
    const Float4v sizes = maximum(maximum(Float4v{} - low, high), Float4v{});
    const float largest = std::max({sizes[0], sizes[1], sizes[2]});
    assert(std::isfinite(largest));  // coordinates are at most max_coordinate
    const float slack = largest * plane_slack_factor;
    low -= slack;
    high += slack;
    for (int axis = 0; axis < 3; ++axis) {
        node.planes[low_row(axis)][lane] = low[axis];
        node.planes[high_row(axis)][lane] = high[axis];
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

// Writes the triangles of a full block at once, on vectors. False, and they must be written one by one, if one is out
// of range or the vertices are doubles.
inline bool write_full_block(TriangleBlock& block, const Mesh<float>& mesh, const std::uint32_t* prims,
                             Accuracy accuracy) {
    Float4v corner[block_width][3];
    bool in_range = true;
    for (std::size_t lane = 0; lane < block_width; ++lane) {
        auto& [a, b, c] = corner[lane];
        a = load_corner(mesh, prims[lane], 0);
        b = load_corner(mesh, prims[lane], 1);
        c = load_corner(mesh, prims[lane], 2);
        in_range &= are_in_range(a, b, c);
        if (accuracy == Accuracy::fast) {
            b -= a;
            c -= a;
        }
        block.prim[lane] = static_cast<std::int32_t>(prims[lane]);
    }
    for (int k = 0; k < 3; ++k) {
        const Float4v xy01 = __builtin_shufflevector(corner[0][k], corner[1][k], 0, 4, 1, 5),
                      xy23 = __builtin_shufflevector(corner[2][k], corner[3][k], 0, 4, 1, 5),
                      z01 = __builtin_shufflevector(corner[0][k], corner[1][k], 2, 6, 2, 6),
                      z23 = __builtin_shufflevector(corner[2][k], corner[3][k], 2, 6, 2, 6);
        const Float4v rows[3] = {__builtin_shufflevector(xy01, xy23, 0, 1, 4, 5),
                                 __builtin_shufflevector(xy01, xy23, 2, 3, 6, 7),
                                 __builtin_shufflevector(z01, z23, 0, 1, 4, 5)};
        for (int axis = 0; axis < 3; ++axis)
            std::memcpy(block.rows[triangle_row(k, axis)], &rows[axis], sizeof rows[axis]);
    }
    return in_range;
}
inline bool write_full_block(TriangleBlockOf<double>&, const Mesh<double>&, const std::uint32_t*, Accuracy) {
    return false;
}

}  // namespace wive
