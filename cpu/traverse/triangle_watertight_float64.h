// t, u and v of hits on triangles of doubles, from the weights of triangle_watertight.h. There is no wider type to
// compute the weights in again; when their rounding matters, they are computed exactly, from products whose rounding
// error is known (Dekker 1971).
//
// e = 2^-53; x, y and z are the rounded corners, exact from here on. A weight is off by less than 4e X Y, X the largest
// |x|, Y the largest |y| of the lane, so that a hit, as a convex combination of the corners, lies no more than 12e X^2
// Y / W aside of the ray, W the sum of the weights. Down to W = 2^-26 X Y that is 1.5u X < 3u M in the units of
// frame.h, which the slack of the boxes covers: t always lies within the boxes around the triangle.
#pragma once

#include <cstddef>

#include "core/error_free.h"
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

// t, u and v of the hits in a block.
template <Isa I>
class Float64Hits {
    using Double4 = typename I::Double4;

public:
    alignas(32) double t[4], u[4], v[4];

    // Takes the mask of the lanes that may be hit, in which no weight has the wrong sign; returns that of the hits.
    [[gnu::always_inline]] unsigned solve(unsigned hit_mask, const Double4 (&x)[3], const Double4 (&y)[3],
                                          const Double4 (&z)[3], const Double4 (&weight)[3], double forward) {
        const Double4 det = weight[0] + weight[1] + weight[2], zero = Double4::all(0.0);
        const Double4 height = weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2];
        (height / (det * Double4::all(forward))).store(t);
        (weight[1] / det).store(u);
        (weight[2] / det).store(v);
        const Double4 product_bound = largest(x) * largest(y);
        const unsigned doubt = hit_mask & (less_equal(abs(det), product_bound * Double4::all(0x1p-26)) |
                                           equal(weight[0], zero) | equal(weight[1], zero) | equal(weight[2], zero));
        if (doubt != 0) [[unlikely]] {
            Corners corners;  // copied here: without an address of their own, x, y and z stay in registers
            for (int k = 0; k < 3; ++k) {
                x[k].store(corners.x[k]);
                y[k].store(corners.y[k]);
                z[k].store(corners.z[k]);
            }
            hit_mask = solve_exactly(hit_mask, doubt, corners, forward);
        }
        return hit_mask;
    }

private:
    struct Corners {
        alignas(32) double x[3][4], y[3][4], z[3][4];
    };

    [[gnu::always_inline]] static Double4 largest(const Double4 (&a)[3]) {
        return max(max(abs(a[0]), abs(a[1])), abs(a[2]));
    }

    // Solves the lanes in doubt again, with exact signs: signs that differ, or all zero (edge-on), are a miss.
    [[gnu::noinline]] unsigned solve_exactly(unsigned hit_mask, unsigned doubt, const Corners& corners,
                                             double forward) {
        const auto& [x, y, z] = corners;
        for (; doubt != 0; doubt &= doubt - 1) {
            const int lane = __builtin_ctz(doubt);
            double weight[3];
            for (int k = 0; k < 3; ++k) {
                const int i = (k + 2) % 3, j = (k + 1) % 3;
                weight[k] = exact_weight(x[i][lane], y[i][lane], x[j][lane], y[j][lane]);
            }
            const bool negative = weight[0] < 0 || weight[1] < 0 || weight[2] < 0;
            const bool positive = weight[0] > 0 || weight[1] > 0 || weight[2] > 0;
            if (negative == positive) hit_mask &= ~(1u << lane);
            const double det = weight[0] + weight[1] + weight[2];
            const double height = weight[0] * z[0][lane] + weight[1] * z[1][lane] + weight[2] * z[2][lane];
            t[lane] = height / (det * forward);
            u[lane] = weight[1] / det + 0.0;  // no -0
            v[lane] = weight[2] / det + 0.0;
        }
        return hit_mask;
    }
};

}  // namespace wive::WIVE_ISA
