// How far a point is from the eight boxes of a node: never farther than from the triangles in them.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "core/layout.h"
#include "traverse/slabs.h"

namespace wive::WIVE_ISA {

// A point outside the tree is taken to the nearest point c of the box round the tree's centre: s is how far, on each
// axis, and g = gap from c to a box, so that the squared distance is sum (g + s)^2. What is computed and compared is
// sum g (g + 2 s), which leaves out sum s^2: so boxes can be told apart from far away as well as from near by.
//
// Distances to planes are those of a slab test: plane * scale + bias, whose direction is +scale for low planes and
// -scale for high ones. The scale is a power of two, for which all numbers are about 1: no product overflows, and none
// that matters underflows. No box with a child has a value above 100, and no lane without one a value below 2^30.
//
// With planes p and c relative to the tree's centre, let P = max |p| over the axes and C = max |c|, u = 2^-24. Rounding
// moves a gap by at most u C from c, u C from the bias, and u (P + C) from the sum; compressed, by u (P + C) for the
// inner sum as well: 2 u P + 4 u C, all in the unit of p. Planes lie 16 u P outside the box (build/write_node.h), and
// the bias has a slack of 16 u C. So a computed gap, which may become as low as -s, is at least 14 u P + 12 u C too
// small, and with it the distance. Rounding s and the sums adds at most 4 u (P + C) to that. The distance to a triangle
// (triangle_distance.inc) may come out too small by 2^-23 of its longest edge, below 7 u P, and by a few 2^-53 of
// itself, for which limit() allows.
template <Isa I, NodeLayout<I> L>
struct PointBoxes {
    using Layout = L;
    using Node = typename Layout::Node;
    using Float8 = typename I::Float8;

    float low_bias[3], high_bias[3];
    float beyond[3];  // s, scaled
    float scale;
    double beyond_squared;  // sum s^2, not scaled

    [[gnu::always_inline]] void load(const BvhView& bvh, const double* point) {
        constexpr float slack_factor = 0x1p-20f, least_magnitude = 0x1p-100f;
        constexpr int mantissa = 23;
        constexpr std::uint32_t twice_one = 254;
        float nearest[3], size = 0, magnitude = 0;
        double away[3];
        beyond_squared = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const double relative = point[axis] - bvh.center[axis], extent = bvh.extent[axis];
            nearest[axis] = static_cast<float>(relative < -extent ? -extent : relative > extent ? extent : relative);
            const double rest = __builtin_fabs(relative) - extent;
            away[axis] = rest > 0 ? rest : 0;
            beyond_squared += away[axis] * away[axis];
            size = std::max(size, __builtin_fabsf(nearest[axis]));
            magnitude = std::max(magnitude, bvh.extent[axis] + static_cast<float>(away[axis]));
        }
        magnitude += size + least_magnitude;
        scale = std::bit_cast<float>((twice_one - (std::bit_cast<std::uint32_t>(magnitude) >> mantissa)) << mantissa);
        const float slack = size * scale * slack_factor;
        for (int axis = 0; axis < 3; ++axis) {
            low_bias[axis] = -(nearest[axis] * scale + slack);
            high_bias[axis] = nearest[axis] * scale - slack;
            beyond[axis] = static_cast<float>(away[axis] * scale);
        }
    }

    // The largest value of a box that may hold a triangle at this squared distance.
    [[gnu::always_inline]] float limit(double squared) const {
        constexpr double rounding = 0x1p-44, margin = 0x1p-22, most = 0x1p16;
        const double rest = squared * (1 + rounding) - beyond_squared * (1 - rounding), scaled = rest * scale * scale;
        return scaled < most ? static_cast<float>(scaled + __builtin_fabs(scaled) * margin) + 0x1p-148f
                             : static_cast<float>(most);
    }

    // By slot, and which are at most `limit`. Lanes without a child may have any distance.
    [[gnu::always_inline]] BoxHits<I> test(const Node& node, float limit) const {
        constexpr AllChildren<Float8> children;
        const Float8 up = Float8::all(scale), down = Float8::all(-scale);
        const auto gap = [&](unsigned axis) {
            const auto row = static_cast<std::size_t>(low_row(static_cast<int>(axis))) * node_width;
            const Float8 low = Layout::distance(node, children, row, axis, up, Float8::all(low_bias[axis]));
            const Float8 high =
                Layout::distance(node, children, row + node_width, axis, down, Float8::all(high_bias[axis]));
            return max(max(low, high), Float8::all(-beyond[axis]));
        };
        const Float8 x = gap(0), y = gap(1), z = gap(2);
        const auto twice = [&](int axis) { return Float8::all(2 * beyond[axis]); };
        const Float8 outside = multiply_add(x, twice(0), multiply_add(y, twice(1), z * twice(2)));
        const Float8 squared = multiply_add(x, x, multiply_add(y, y, multiply_add(z, z, outside)));
        return Layout::drop_empty_lanes(node, BoxHits<I>{squared, hits(squared, Float8::all(limit))});
    }
};

}  // namespace wive::WIVE_ISA
