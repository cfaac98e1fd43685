// Where a ray meets triangles of doubles, from the weights of triangle_watertight.h. There is no wider type to take
// them in again: where their rounding shows, they are taken without it, by products whose rounded-off part is known
// (Dekker 1971).
//
// e = 2^-53; x, y and z are the rounded corners, exact from here on. A weight is off by less than 4e X Y, X the largest
// |x|, Y the largest |y| of the lane, so that the convex combination of corners that a hit is lies no more than 12e X^2
// Y / W aside of the ray, W the weights' sum. Down to W = 2^-26 X Y that is 1.5u X < 3u M in the units of frame.h,
// which the boxes' slack covers: t always lies where the triangle's boxes are looked for.
#pragma once

#include <cstddef>

#include "core/error_free.h"
#include "traverse/frame.h"

namespace wive {

// x1 y2 - y1 x2 with the exact sign, and zero only where it is zero: the sum of two products and of what was rounded
// off.
[[gnu::always_inline]] inline double exact_weight(double x1, double y1, double x2, double y2) {
    const double a = x1 * y2, b = y1 * x2;
    const double a_low = rounded_off_product(x1, y2, a), b_low = -rounded_off_product(y1, x2, b);
    const double low = a_low + b_low;
    return ((a - b) + low) + rounded_off_sum(a_low, b_low, low);
}

// Lanes of a block that may be hit, in which no weight has the wrong sign: t, u, v and the lanes that are hit.
template <class Isa>
class Solution64 {
    using Double4 = typename Isa::Double4;

public:
    alignas(32) double t[4], u[4], v[4];

    [[gnu::always_inline]] unsigned solve(unsigned lanes, const Double4 (&x)[3], const Double4 (&y)[3],
                                          const Double4 (&z)[3], const Double4 (&weight)[3], double forward) {
        const Double4 det = weight[0] + weight[1] + weight[2], zero = Double4::all(0.0);
        const Double4 height = weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2];
        (height / (det * Double4::all(forward))).store(t);
        (weight[1] / det).store(u);
        (weight[2] / det).store(v);
        const Double4 reach = largest(x) * largest(y);
        const unsigned doubt = lanes & (less_equal(abs(det), reach * Double4::all(0x1p-26)) | equal(weight[0], zero) |
                                        equal(weight[1], zero) | equal(weight[2], zero));
        if (doubt != 0) [[unlikely]] {
            Corners corners;  // made here: the vectors themselves need no address, and so stay in registers
            for (int k = 0; k < 3; ++k) {
                x[k].store(corners.x[k]);
                y[k].store(corners.y[k]);
                z[k].store(corners.z[k]);
            }
            lanes = solve_exactly(lanes, doubt, corners, forward);
        }
        return lanes;
    }

private:
    struct Corners {
        alignas(32) double x[3][4], y[3][4], z[3][4];
    };

    [[gnu::always_inline]] static Double4 largest(const Double4 (&a)[3]) {
        return max(max(abs(a[0]), abs(a[1])), abs(a[2]));
    }

    // The lanes in doubt again, with exact signs: on both sides of the ray, or edge-on, is a miss.
    [[gnu::noinline]] unsigned solve_exactly(unsigned lanes, unsigned doubt, const Corners& corners, double forward) {
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
            if (negative == positive) lanes &= ~(1u << lane);
            const double det = weight[0] + weight[1] + weight[2];
            const double height = weight[0] * z[0][lane] + weight[1] * z[1][lane] + weight[2] * z[2][lane];
            t[lane] = height / (det * forward);
            u[lane] = weight[1] / det + 0.0;  // no -0
            v[lane] = weight[2] / det + 0.0;
        }
        return lanes;
    }
};

}  // namespace wive
