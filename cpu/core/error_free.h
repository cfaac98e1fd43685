// Rounding errors of a sum and of a product of doubles, which are doubles themselves. Always inlined, as everything
// that kernels call (see TriangleBlockOf in layout.h).
#pragma once

namespace wive {

// (a + b) - sum, where sum is a + b rounded: Knuth's two-sum.
[[gnu::always_inline]] inline double rounded_off_sum(double a, double b, double sum) {
    const double b_part = sum - a;
    return (a - (sum - b_part)) + (b - b_part);
}

// x y - product, where product is x y rounded. Exact unless it underflows: |x y| must be zero or above 2^-916.
[[gnu::always_inline]] inline double rounded_off_product(double x, double y, double product) {
    return __builtin_fma(x, y, -product);
}

}  // namespace wive
