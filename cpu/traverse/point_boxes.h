// The squared distances from a point to the eight boxes of a node, never above those to the triangles in them.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

#include "core/layout.h"
#include "traverse/slabs.h"

namespace wive::WIVE_ISA {

// Distances to planes are those of a slab test: plane * scale + bias, whose direction is +scale for low planes and
// -scale for high ones. The scale is a power of two, for which all numbers are about 1: no square overflows, and none
// that matters underflows.
//
// With planes p and the point o relative to the tree's centre, let P = max |p| over the axes and O = max |o|, u =
// 2^-24. Rounding moves a computed distance to a plane by at most u O from o, u O from the bias, and u (P + O) from the
// sum; compressed, by u (P + O) for the inner sum as well: 2 u P + 4 u O, all in the unit of p. Planes lie 16 u P
// outside the box (build/write_node.h), and the bias has a slack of 16 u O. So a computed gap, and with it the
// distance, is at least 14 u P + 12 u O too small. The sum of squares may make the distance 1.5 u of itself larger,
// below 3 u (P + O). The distance to a triangle (triangle_distance.inc) may come out too small by 2^-23 (d + L) at
// most, d being the distance and L the longest edge, which is below 8 u P + 3 u O: 11 u P + 6 u O in all.
template <Isa I, NodeLayout<I> L>
struct PointBoxes {
    using Layout = L;
    using Node = typename Layout::Node;
    using Float8 = typename I::Float8;
    using Float4 = typename I::Float4;
    using Real4 = typename I::Real4;

    alignas(16) float low_bias[4], high_bias[4];
    float scale;

    // position: x, y, z and the tree's lane 3, which is zero.
    [[gnu::always_inline]] void load(const BvhView& bvh, Real4 position) {
        constexpr float slack_factor = 0x1p-20f, least_magnitude = 0x1p-100f;
        constexpr int mantissa = 23;
        constexpr std::uint32_t twice_one = 254;
        const Float4 relative = Float4::narrow(position - Real4::of(Float4::load(bvh.center)));
        const float size = highest_lane(abs(relative));
        const float magnitude = size + highest_lane(Float4::load(bvh.extent)) + least_magnitude;
        scale = std::bit_cast<float>((twice_one - (std::bit_cast<std::uint32_t>(magnitude) >> mantissa)) << mantissa);
        const Float4 scaled = relative * Float4::all(scale), slack = Float4::all(size * scale * slack_factor);
        (Float4::all(0) - (scaled + slack)).store(low_bias);
        (scaled - slack).store(high_bias);
    }

    // The largest value of squared_distances() that a box with a triangle at this squared distance may have.
    [[gnu::always_inline]] float limit(double squared) const {
        constexpr double margin = 1 + 0x1p-22;
        const double scaled = squared * scale * scale * margin, most = std::numeric_limits<float>::max();
        return scaled < most ? static_cast<float>(scaled) + 0x1p-148f : std::numeric_limits<float>::max();
    }

    // By slot, and which are at most `limit`. Lanes without a child may have any distance.
    [[gnu::always_inline]] BoxHits<I> test(const Node& node, float limit) const {
        constexpr AllChildren<Float8> children;
        const Float8 zero = Float8::all(0), up = Float8::all(scale), down = Float8::all(-scale);
        const auto gap = [&](unsigned axis) {
            const auto row = static_cast<std::size_t>(low_row(static_cast<int>(axis))) * node_width;
            const Float8 low = Layout::distance(node, children, row, axis, up, Float8::all(low_bias[axis]));
            const Float8 high =
                Layout::distance(node, children, row + node_width, axis, down, Float8::all(high_bias[axis]));
            return max(max(low, high), zero);
        };
        const Float8 x = gap(0), y = gap(1), z = gap(2);
        const Float8 squared = multiply_add(x, x, multiply_add(y, y, z * z));
        return Layout::drop_empty_lanes(node, BoxHits<I>{squared, hits(squared, Float8::all(limit))});
    }
};

}  // namespace wive::WIVE_ISA
