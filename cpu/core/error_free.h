// What rounding takes off a sum or a product of doubles, itself a double. Always inlined, as all that kernels call.
#pragma once

namespace wive {

// a + b less sum, which is a + b rounded: Knuth's two-sum.
[[gnu::always_inline]] inline double rounded_off_sum(double a, double b, double sum) {
    const double b_part = sum - a;
    return (a - (sum - b_part)) + (b - b_part);
}

// x y less product, which is x y rounded: exact where it does not underflow, |x y| being zero or above 2^-916.
[[gnu::always_inline]] inline double rounded_off_product(double x, double y, double product) {
    return __builtin_fma(x, y, -product);
}

}  // namespace wive
