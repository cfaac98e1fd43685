// t, u and v of hits on triangles of doubles, from the weights of triangle_watertight.h. There is no wider type to
// compute the weights in again; when their rounding matters, they are computed exactly, from products whose rounding
// error is known (Dekker 1971).
//
// e = 2^-53; x, y and z are the rounded corners, exact from here on. A weight is off by less than 4e X Y, X the largest
// |x|, Y the largest |y| of the lane, so that a hit, as a convex combination of the corners, lies no more than 12e X^2
// Y / W aside of the ray, W the sum of the weights. Down to W = 2^-26 X Y that is 1.5u X < 3u M in the units of
// frame.h, which the slack of the boxes covers: t always lies within the boxes around the triangle.
#pragma once

#include <cmath>
#include <cstddef>

#include "core/error_free.h"
#include "traverse/crossings.h"
#include "traverse/frame.h"

namespace wive::WIVE_ISA {

// x1 y2 - y1 x2 with the exact sign, and zero only if it is exactly zero: the difference of the rounded products plus
// what rounding took off them.
[[gnu::always_inline]] inline double exact_weight(double x1, double y1, double x2, double y2) {
    const double a = x1 * y2, b = y1 * x2;
    const double a_low = rounded_off_product(x1, y2, a), b_low = -rounded_off_product(y1, x2, b);
    const double low = a_low + b_low;
    return ((a - b) + low) + rounded_off_sum(a_low, b_low, low);
}

// t and, if wanted, u and v of the hits in a block.
template <Isa I, bool wants_uv>
class Float64Hits {
    using Double4 = typename I::Double4;

public:
    alignas(32) double t[4], u[4], v[4];

    // Takes the mask of the lanes that may be hit, in which no weight has the wrong sign; returns that of the hits.
    [[gnu::always_inline]] unsigned solve(unsigned hit_mask, const Double4 (&x)[3], const Double4 (&y)[3],
                                          const Double4 (&z)[3], const Double4 (&weight)[3], double forward,
                                          bool crossings) {
        const Double4 det = weight[0] + weight[1] + weight[2], zero = Double4::all(0.0);
        const Double4 height = weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2];
        (height / (det * Double4::all(forward))).store(t);
        if constexpr (wants_uv) {
            (weight[1] / det).store(u);
            (weight[2] / det).store(v);
        }
        const Double4 least = max(largest(x) * largest(y) * Double4::all(0x1p-26), Double4::all(smallest_det));
        const unsigned doubt = hit_mask & (less_equal(abs(det), least) | equal(weight[0], zero) |
                                           equal(weight[1], zero) | equal(weight[2], zero));
        if (doubt != 0) [[unlikely]] {
            Corners corners;  // copied here: without an address of their own, x, y and z stay in registers
            for (int k = 0; k < 3; ++k) {
                x[k].store(corners.x[k]);
                y[k].store(corners.y[k]);
                z[k].store(corners.z[k]);
            }
            hit_mask = solve_exactly(hit_mask, doubt, corners, forward, crossings);
        }
        return hit_mask;
    }

private:
    // Above it no product that matters underflows.
    static constexpr double smallest_det = 0x1p-400;

    struct Corners {
        alignas(32) double x[3][4], y[3][4], z[3][4];
    };

    [[gnu::always_inline]] static Double4 largest(const Double4 (&a)[3]) {
        return max(max(abs(a[0]), abs(a[1])), abs(a[2]));
    }

    // Scales corners up until products of them don't underflow; the signs and ratios of weights stay.
    static void scale_up(double (&x)[3], double (&y)[3]) {
        double size = 0;
        for (int k = 0; k < 3; ++k) {
            size = std::fabs(x[k]) > size ? std::fabs(x[k]) : size;
            size = std::fabs(y[k]) > size ? std::fabs(y[k]) : size;
        }
        for (; size > 0 && size < 0x1p-300; size *= 0x1p300)
            for (int k = 0; k < 3; ++k) {
                x[k] *= 0x1p300;
                y[k] *= 0x1p300;
            }
    }

    // Solves the lanes in doubt again, with exact signs: signs that differ, or all zero (edge-on), are a miss.
    [[gnu::noinline]] unsigned solve_exactly(unsigned hit_mask, unsigned doubt, const Corners& corners, double forward,
                                             bool crossings) {
        for (; doubt != 0; doubt &= doubt - 1) {
            const int lane = __builtin_ctz(doubt);
            double x[3], y[3], z[3], weight[3];
            for (int k = 0; k < 3; ++k) {
                x[k] = corners.x[k][lane];
                y[k] = corners.y[k][lane];
                z[k] = corners.z[k][lane];
            }
            scale_up(x, y);
            for (int k = 0; k < 3; ++k) {
                const int i = (k + 2) % 3, j = (k + 1) % 3;
                weight[k] = exact_weight(x[i], y[i], x[j], y[j]);
            }
            if (side_passed(x, y, weight, crossings) == 0) hit_mask &= ~(1u << lane);
            const double det = weight[0] + weight[1] + weight[2];
            // Shares before products, which could underflow otherwise.
            const double depth = weight[0] / det * z[0] + weight[1] / det * z[1] + weight[2] / det * z[2];
            t[lane] = depth / forward;
            u[lane] = weight[1] / det + 0.0;  // no -0
            v[lane] = weight[2] / det + 0.0;
        }
        return hit_mask;
    }
};

}  // namespace wive::WIVE_ISA
