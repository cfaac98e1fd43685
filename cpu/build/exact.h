// Exact signs of sums of doubles (Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic"). Slow: called only if
// a cheap filter is in doubt.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/error_free.h"

namespace wive {

// The sign of the exact sum of the terms: -1, 0 or 1. Grow-Expansion with zero elimination, Shewchuk's figure 4.
template <std::size_t count>
int sign_of_sum(const std::array<double, count>& terms) {
    std::array<double, count> expansion{};
    std::size_t size = 0;
    for (const double term : terms) {
        double sum = term;
        std::size_t kept = 0;
        for (std::size_t i = 0; i < size; ++i) {
            const double a = sum, b = expansion[i];
            sum = a + b;
            const double error = rounded_off_sum(a, b, sum);
            if (error != 0) expansion[kept++] = error;
        }
        if (sum != 0 || kept == 0) expansion[kept++] = sum;
        size = kept;
    }
    const double largest = expansion[size - 1];
    return (largest > 0) - (largest < 0);
}

// The exact sign of the area of (a, b, c) in the plane. A product of two floats is exact in double. A product of
// doubles is the sum of two doubles unless it underflows: if all coordinates are small they are scaled up; otherwise
// they must be zero or above 1e-130.
inline int orientation(const double a[2], const double b[2], const double c[2]) {
    double size = 0, scale = 1;
    for (const double* p : {a, b, c}) size = std::max({size, std::abs(p[0]), std::abs(p[1])});
    while (size > 0 && size < 0x1p-300) {
        size *= 0x1p300;
        scale *= 0x1p300;
    }
    std::array<double, 12> terms{};
    std::size_t count = 0;
    const auto add_product = [&](double x, double y) {  // the rounded product and its rounding error
        x *= scale;
        y *= scale;
        terms[count] = x * y;
        terms[count + 1] = rounded_off_product(x, y, terms[count]);
        count += 2;
    };
    add_product(a[0], b[1]), add_product(-a[1], b[0]);
    add_product(b[0], c[1]), add_product(-b[1], c[0]);
    add_product(c[0], a[1]), add_product(-c[1], a[0]);
    return sign_of_sum(terms);
}
inline int orientation(const float a[2], const float b[2], const float c[2]) {
    const auto product = [](float x, float y) { return static_cast<double>(x) * static_cast<double>(y); };
    return sign_of_sum(std::array<double, 6>{product(a[0], b[1]), -product(a[1], b[0]),  //
                                             product(b[0], c[1]), -product(b[1], c[0]),  //
                                             product(c[0], a[1]), -product(c[1], a[0])});
}

}  // namespace wive
