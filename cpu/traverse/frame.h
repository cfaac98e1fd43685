// A ray prepared for traversal: checked and scaled, with its reciprocal and slab offsets computed once.
#pragma once

#include <bit>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "core/interval.h"
#include "core/layout.h"
#include "core/ray.h"
#include "traverse/concepts.h"
#include "traverse/scaled_limits.h"

namespace wive::WIVE_ISA {

// The shift to an octant's bits in a lane of the order row, four bits per octant. Farthest child first, as the stack
// needs: octant 7 - o is octant o in reverse.
[[gnu::always_inline]] constexpr unsigned order_shift_of_octant(unsigned octant) { return 4 * (7 - octant); }
[[gnu::always_inline]] constexpr unsigned octant_of_order_shift(unsigned shift) { return 7 - shift / 4; }

// The rows of planes that rays of an octant meet first and last on an axis, in planes from the node's first.
[[gnu::always_inline]] constexpr unsigned near_row_of(unsigned octant, unsigned axis) {
    return node_width * (2 * axis + (octant >> axis & 1u));
}
[[gnu::always_inline]] constexpr unsigned far_row_of(unsigned octant, unsigned axis) {
    return near_row_of(octant, axis) ^ node_width;
}

// The direction is divided by a power of two so that its longest component lies in [1, 2), whatever its length; t
// scales with it, and both scalings are exact. Everything below is in these scaled units until a hit is written.
//
// Nothing here or in a slab test overflows: |r| is at most 2^30, planes and origins are below 2^62 (max_coordinate),
// the planes of empty lanes 2^80 (empty_plane), so no distance exceeds 2^111 and none is NaN. An empty lane's box,
// whose near plane lies 2^81 behind its far plane on every axis, is therefore never hit.
//
// Slabs are conservative at no cost to the loop. With planes p and origin o relative to the tree's centre, the
// distance to a plane is computed as fma(p, r, bias), r = 1/d and bias = -o r -+ slack, where, in the roundoff
// u = 2^-24, P = |p| and O = |o| on that axis, the errors add up, as lengths along the axis, to
//     2u(P + O)  from r and from o r,      u(2P + 2O)  from rounding bias and result,
//     u O        from o = origin - centre, u P         if there is no fused multiply-add,
// and the triangle test (triangle_watertight.h) moves a vertex sideways by at most 6u max(P + O). All of it is
// below 12u M, M = max over the axes of P, of any of the box's planes, + max over the axes of O. The planes of a node
// are 16u max P outside the box (build/write_node.h), and slack = |r| 16u max O: no box that holds a triangle the test
// accepts is ever missed, and how small a box can be told apart depends on where it lies, not on the tree's extent.
// Compressed planes (compressed_slabs.h) are met at fma(byte, step r, fma(origin, r, bias)). step r is exact, the step
// being a power of two far from underflow; rounding the inner sum adds u(P + O), and the product of the byte 2u P if
// there is no fused multiply-add, P here being that of the whole node, by which its planes are moved once more. Such
// planes may lie up to a step outside, which is below P / 60: 15u M in all.
// A float64 ray meets the same boxes, all of this in float: its direction is rounded, which adds u(P + O) from r; o =
// origin - centre is taken in double, so that its one rounding to float is the u O above. The triangle tests move
// vertices sideways by multiples of 2^-53 M; if rounding of the weights would move a hit by more, they are computed
// exactly (triangle_watertight_float64.h), so that a hit lies no more than 3u M aside: 13u M in all with compressed
// planes. A component smaller than 2^-30 of the longest is replaced by that, with its sign: along the
// ray that moves a point by less than 2^-29 M, which the same slack covers.
// From far away, slack of 16u O would make all boxes of a detail overlap. Where a triangle test is that much finer, the
// ray starts for boxes where it comes nearest to the centre, o', found in double, and distances to boxes count from
// there: O is then that of o', and 2^-28 of the origin's own O covers what double rounds, less than 2^-51 O.
//
// Real is the precision of the caller's rays and of the triangle test.
template <Isa I>
struct RayFrame {
    using Real = typename I::Real;
    using Real4 = typename I::Real4;
    using Float4 = typename I::Float4;

    // Three values each; the fourth lane only fills up a register.
    alignas(4 * sizeof(Real)) Real origin[4];
    alignas(4 * sizeof(Real)) Real direction[4];
    alignas(16) float rdir[4];
    alignas(16) float near_bias[4];
    alignas(16) float far_bias[4];
    Interval<Real> interval;
    Real unscale;                                        // a power of two; t here = unscale * t of the caller's ray
    std::uint32_t near_row[3], far_row[3], order_shift;  // those of its octant
    unsigned longest_axis;

    static constexpr float slack_factor = 0x1p-20f;
    static constexpr float least_magnitude = 0x1p-100f;  // keeps the slack from vanishing if everything is tiny

    // Returns false if the ray hits nothing by rule: if its origin or direction is NaN or out of range, its direction
    // zero or its interval empty.
    [[gnu::always_inline]] bool load(const BvhView& bvh, const RayBatch<Real>& rays, std::size_t i) {
        const Real *o = rays.origins + 3 * i, *d = rays.directions + 3 * i;
        const Real4 caller_origin = Real4::set(o[0], o[1], o[2], 0), caller_direction = Real4::set(d[0], d[1], d[2], 0);
        const Real caller_tmin = rays.tmin[i * rays.tmin_stride], caller_tmax = rays.tmax[i * rays.tmax_stride];

        const Real4 lengths = abs(caller_direction);
        const unsigned in_range = less_equal(abs(caller_origin), Real4::all(max_coordinate<Real>)) &
                                  less_equal(lengths, Real4::all(std::numeric_limits<Real>::max()));
        const Real longest = highest_lane(lengths);
        // The power of two that scales the direction, and its reciprocal, must be normal numbers. Zero has none.
        using Bits = std::conditional_t<sizeof(Real) == sizeof(float), std::uint32_t, std::uint64_t>;
        constexpr int mantissa = std::numeric_limits<Real>::digits - 1;
        constexpr Bits one = std::bit_cast<Bits>(Real{1}) >> mantissa;  // the exponent field of 1
        const Bits exponent = std::bit_cast<Bits>(longest) >> mantissa;
        if ((in_range != 15u) | (exponent - 1 >= 2 * one - 1) | !(caller_tmin <= caller_tmax)) [[unlikely]] {
            if ((in_range != 15u) | (longest == 0) | !(caller_tmin <= caller_tmax)) return false;
            return load_extreme(bvh, caller_origin, caller_direction, caller_tmin, caller_tmax);
        }
        const Real scale = std::bit_cast<Real>((2 * one - exponent) << mantissa);
        unscale = std::bit_cast<Real>(exponent << mantissa);
        const Real4 scaled_direction = caller_direction * Real4::all(scale);
        const Real near = caller_tmin * unscale, far = caller_tmax * unscale;
        interval = Interval<Real>::of(near, far);

        constexpr float smallest_part = 0x1p-30f;
        const Float4 scaled = Float4::narrow(scaled_direction);  // signs are kept, even if a component becomes zero
        const Float4 relative = Float4::narrow(caller_origin - Real4::of(Float4::load(bvh.center)));
        const float magnitude = highest_lane(abs(relative)) + least_magnitude;
        const float smallest = static_cast<float>(longest * scale) * smallest_part;
        const Float4 size = Float4::all(1.0f) / max(abs(scaled), Float4::all(smallest));
        const Float4 reciprocal = flip_sign(size, scaled);
        const Float4 distance = relative * reciprocal, slack = size * Float4::all(magnitude * slack_factor);
        const unsigned octant = sign_bits(scaled) & 7u;  // bit a: negative on axis a, from the sign of the reciprocal
        order_shift = order_shift_of_octant(octant);
        longest_axis = static_cast<unsigned>(std::countr_zero(less_equal(Real4::all(longest), lengths)));
        assert(longest_axis < 3);
        for (unsigned axis = 0; axis < 3; ++axis) {
            near_row[axis] = near_row_of(octant, axis);
            far_row[axis] = far_row_of(octant, axis);
        }
        caller_origin.store(origin);
        scaled_direction.store(direction);
        reciprocal.store(rdir);
        (Float4::all(0.0f) - (distance + slack)).store(near_bias);
        (slack - distance).store(far_bias);
        if (!scales_exactly(caller_tmin, caller_tmax, near, far))
            [[unlikely]]  // a call, so here, where no vector is live
            interval = scaled_limits(caller_tmin, caller_tmax, unscale);
        if constexpr (std::is_same_v<Real, double>)
            if (magnitude > bvh.far_away) [[unlikely]]
                interval.start_boxes_at(bring_boxes_near(bvh));
        return true;
    }

    // Lets the ray start for boxes where it comes nearest to the centre, if that is much nearer. Returns t there; the
    // interval's ends for boxes are the caller's to adapt.
    [[gnu::noinline]] Real bring_boxes_near(const BvhView& bvh) {
        double from[3], distance = 0, nearest = 0, along = 0, squared = 0;
        for (int axis = 0; axis < 3; ++axis) {
            from[axis] = static_cast<double>(origin[axis]) - static_cast<double>(bvh.center[axis]);
            const double way = direction[axis];
            along -= from[axis] * way;
            squared += way * way;
            distance = std::fmax(distance, std::fabs(from[axis]));
        }
        const Real start = static_cast<Real>(along / squared);
        for (int axis = 0; axis < 3; ++axis) {
            from[axis] += static_cast<double>(start) * static_cast<double>(direction[axis]);
            nearest = std::fmax(nearest, std::fabs(from[axis]));
        }
        if (!(nearest <= distance / 4)) return 0;
        const float magnitude = static_cast<float>(nearest + 0x1p-27 * distance) + least_magnitude;
        for (int axis = 0; axis < 3; ++axis) {
            const float to_origin = static_cast<float>(from[axis]) * rdir[axis];
            const float slack = std::fabs(rdir[axis]) * (magnitude * slack_factor);
            near_bias[axis] = -(to_origin + slack);
            far_bias[axis] = slack - to_origin;
        }
        return start;
    }

    // Whether the ray starts elsewhere for boxes than for triangles.
    [[gnu::always_inline]] bool has_box_start() const {
        if constexpr (std::is_same_v<Real, double>) return interval.box_start != 0;
        return false;
    }

    // Loads a ray whose direction is subnormal, or so long that the reciprocal of its power of two is.
    [[gnu::noinline]] bool load_extreme(const BvhView& bvh, Real4 caller_origin, Real4 caller_direction, Real tmin,
                                        Real tmax) {
        constexpr Real up = static_cast<Real>(std::uint64_t{1} << std::numeric_limits<Real>::digits);
        const Real by = highest_lane(abs(caller_direction)) < 1 ? up : Real{0.5};
        alignas(sizeof(Real4)) Real o[4], d[4];
        caller_origin.store(o);
        (caller_direction * Real4::all(by)).store(d);
        if (!load(bvh, {o, d, &tmin, &tmax, 0, 0}, 0)) return false;
        unscale /= by;
        if constexpr (std::is_same_v<Real, double>) {
            const double start = interval.box_start;
            interval = scaled_limits(tmin, tmax, unscale);
            interval.start_boxes_at(start);
        } else
            interval = scaled_limits(tmin, tmax, unscale);
        return true;
    }

    // Whether t can be compared with the scaled limits near and far as well as with the caller's, because neither is
    // nearly subnormal or, on the wrong side, infinite.
    [[gnu::always_inline]] static bool scales_exactly(Real tmin, Real tmax, Real near, Real far) {
        constexpr Real least = 2 * std::numeric_limits<Real>::min(), most = std::numeric_limits<Real>::max();
        if ((tmin == 0) & (tmax > most)) return true;  // the usual limits, for which two comparisons are enough
        return ((tmin == 0) | ((tmin >= least) & (near >= least) & (near <= most))) & (tmax >= least) & (far >= least);
    }

    // What load() guarantees when it returns true; asserted when traversal begins.
    [[gnu::always_inline]] bool is_finite() const {
        constexpr float most_rdir = 0x1p30f, most_bias = 0x1p93f;
        bool finite = interval.tmin == interval.tmin && interval.tmax == interval.tmax;
        for (int axis = 0; axis < 3; ++axis)
            finite = finite && __builtin_isfinite(origin[axis]) && __builtin_isfinite(direction[axis]) &&
                     __builtin_fabsf(rdir[axis]) <= most_rdir && __builtin_fabsf(near_bias[axis]) <= most_bias &&
                     __builtin_fabsf(far_bias[axis]) <= most_bias;
        return finite;
    }
};

// A ray with its axes permuted, so that the longest component of its direction comes last.
template <Isa I>
struct AxisFrame : RayFrame<I> {
    std::uint32_t axis[3];  // a cyclic permutation of 0, 1, 2

    [[gnu::always_inline]] bool load(const BvhView& bvh, const RayBatch<typename I::Real>& rays, std::size_t i) {
        if (!RayFrame<I>::load(bvh, rays, i)) [[unlikely]]
            return false;
        constexpr unsigned following = 0b001001;  // the axis after axis i, two bits each
        axis[2] = this->longest_axis;
        axis[0] = following >> 2 * axis[2] & 3u;
        axis[1] = following >> 2 * axis[0] & 3u;
        return true;
    }

    // The lanes of a block whose triangle lies in a plane across an axis on which the ray's direction, `way`, is zero:
    // the ray sees it edge-on. So do all triangles of a floor or a wall that the ray lies in, without any arithmetic.
    template <class Corners>
    [[gnu::always_inline]] unsigned edge_on(const Corners& corners, const auto& way) const {
        unsigned lanes = 0;
        for (int i = 0; i < 2; ++i) {
            if (way[axis[i]] != 0) continue;
            const auto first = corners.vertex(0, axis[i]);
            lanes |= equal(first, corners.vertex(1, axis[i])) & equal(first, corners.vertex(2, axis[i]));
        }
        return lanes;
    }
};

}  // namespace wive::WIVE_ISA
