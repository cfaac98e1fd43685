// A ray made ready for traversal: checked, scaled, and its reciprocal and slab offsets taken once.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "layout.h"
#include "ray.h"

namespace wive {

// The direction is scaled by a power of two so that its largest component lies in [1, 2); t scales with it, and
// both scalings are exact. Everything below is in these scaled units until a hit is written.
//
// Slabs are conservative at no cost to the loop. With planes p and origin o relative to the tree's centre, the
// distance to a plane is computed as fma(p, r, bias), r = 1/d and bias = -o r -+ slack, where, in the roundoff
// u = 2^-24, P the tree's extent and O = |o| on that axis, the errors add up, as lengths along the axis, to
//     2u(P + O)  from r and from o r,      u(2P + 2O)  from rounding bias and result,
//     u O        from o = origin - centre, u P         where there is no fused multiply-add,
// and the triangle test (triangle_watertight.h) moves a vertex sideways by at most 6u max(P + O). All of it is
// below 12u M, M = max over the axes of (P + O); slack = |r| 16u M covers it. The near distance is lowered and the far
// distance raised by it, so no box that holds a triangle the test accepts is ever missed.
// A component smaller than 2^-30 counts as 2^-30 with its sign: along the ray that moves a point by less than
// 2^-29 M, which the same slack covers.
template <class Isa>
struct RayFrame {
    float origin[3];
    float direction[3];
    float tmin, tmax;
    float scale;  // t of the caller's ray = scale * t here
    float rdir[3];
    float near_bias[3], far_bias[3];
    unsigned octant;  // bit a: negative on axis a, from the sign of the reciprocal

    // False where the ray hits nothing by rule: an origin or a direction that is no number or out of range, a
    // direction of length zero, an empty interval.
    [[gnu::always_inline]] bool load(const BvhView& bvh, const RayBatch& rays, std::size_t i) {
        const float* o = rays.origins + 3 * i;
        const float* d = rays.directions + 3 * i;
        const float caller_tmin = rays.tmin[i * rays.tmin_stride], caller_tmax = rays.tmax[i * rays.tmax_stride];
        constexpr float largest = std::numeric_limits<float>::max();
        bool valid = caller_tmin <= caller_tmax;
        float longest = 0, reach = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const float length = std::abs(d[axis]);
            valid = valid & (std::abs(o[axis]) <= max_coordinate) & (length <= largest);
            longest = longest < length ? length : longest;
        }
        if (!valid | (longest == 0)) return false;

        std::uint32_t exponent = std::bit_cast<std::uint32_t>(longest) >> 23;
        exponent = exponent > 253 ? 253 : exponent;
        scale = std::bit_cast<float>((254 - exponent) << 23);
        const float unscale = std::bit_cast<float>(exponent > 0 ? exponent << 23 : 1u << 22);
        tmin = caller_tmin * unscale;
        tmax = caller_tmax * unscale;

        float relative[3];
        for (int axis = 0; axis < 3; ++axis) {
            origin[axis] = o[axis];
            direction[axis] = d[axis] * scale;
            relative[axis] = o[axis] - bvh.center[axis];
            const float far = bvh.extent[axis] + std::abs(relative[axis]);
            reach = reach < far ? far : reach;
        }
        constexpr float smallest = 0x1p-30f, slack_factor = 0x1p-20f;
        const float length_slack = reach * slack_factor;
        octant = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const float component = direction[axis];
            rdir[axis] = 1.0f / (std::abs(component) < smallest ? std::copysign(smallest, component) : component);
            octant |= (std::bit_cast<std::uint32_t>(rdir[axis]) >> 31) << axis;
            const float distance = -relative[axis] * rdir[axis];
            const float slack = std::abs(rdir[axis]) * length_slack;
            near_bias[axis] = distance - slack;
            far_bias[axis] = distance + slack;
        }
        return true;
    }
};

}  // namespace wive
