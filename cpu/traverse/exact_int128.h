// Integers of 128 bits for the exact ray-triangle test (exact_intersection.inc): all that most triangles need, and many
// times as fast as BigInt.
#pragma once

#include <bit>
#include <cstdint>

namespace wive {

#include "traverse/exact_integer.inc"

__extension__ typedef __int128 Signed128;
__extension__ typedef unsigned __int128 Unsigned128;

// The functions of BigInt that the test uses. Only for numbers that fit: fits_narrow() in exact_hit.cpp.
struct Int128 {
    Signed128 value;

    static int sign_of(const Int128& a) { return int{a.value > 0} - int{a.value < 0}; }
    static int exponent_of(float x) { return BigInt::exponent_of(x); }
    static Int128 multiple(float x, int unit) {
        const std::uint32_t bits = std::bit_cast<std::uint32_t>(x), fraction = bits & 0x7fffffu;
        if (x == 0) return {0};
        const Signed128 size = (bits >> 23 & 255u) > 0 ? fraction | 0x800000u : fraction;
        const Signed128 shifted = size << (exponent_of(x) - unit);
        return {bits >> 31 ? -shifted : shifted};
    }
    static Int128 sum(const Int128& a, const Int128& b) { return {a.value + b.value}; }
    static Int128 difference(const Int128& a, const Int128& b) { return {a.value - b.value}; }
    static Int128 product(const Int128& a, const Int128& b) { return {a.value * b.value}; }

    // The sign of a b - c d, whose products have up to 256 bits.
    static int compare_products(const Int128& a, const Int128& b, const Int128& c, const Int128& d) {
        const int left_sign = sign_of(a) * sign_of(b), right_sign = sign_of(c) * sign_of(d);
        if (left_sign != right_sign) return left_sign > right_sign ? 1 : -1;
        const Product left = size_of_product(a, b), right = size_of_product(c, d);
        if (left.high != right.high) return left.high > right.high ? left_sign : -left_sign;
        if (left.low != right.low) return left.low > right.low ? left_sign : -left_sign;
        return 0;
    }

    static float quotient(const Int128& numerator, const Int128& denominator, int exponent) {
        if (numerator.value == 0) return 0.0f;
        // Two conversions and a division, each rounded.
        const double ratio = static_cast<double>(numerator.value) / static_cast<double>(denominator.value);
        float nearest;
        if (BigInt::nearest_float(ratio, exponent, nearest)) return nearest;
        return BigInt::quotient(big(numerator), big(denominator), exponent);
    }

private:
    struct Product {
        Unsigned128 high, low;
    };
    static Unsigned128 size_of(const Int128& a) {
        return a.value < 0 ? -static_cast<Unsigned128>(a.value) : static_cast<Unsigned128>(a.value);
    }
    // |a b|
    static Product size_of_product(const Int128& a, const Int128& b) {
        const auto high = [](Unsigned128 x) { return static_cast<std::uint64_t>(x >> 64); };
        const auto low = [](Unsigned128 x) { return static_cast<std::uint64_t>(x); };
        const Unsigned128 x = size_of(a), y = size_of(b);
        const Unsigned128 lowest = Unsigned128{low(x)} * low(y), highest = Unsigned128{high(x)} * high(y);
        const Unsigned128 one = Unsigned128{high(x)} * low(y), other = Unsigned128{low(x)} * high(y);
        const Unsigned128 middle = Unsigned128{high(lowest)} + low(one) + low(other);
        return {highest + high(one) + high(other) + high(middle), middle << 64 | low(lowest)};
    }
    static BigInt big(const Int128& a) {
        BigInt r;
        for (int i = 0; i < 4; ++i) r.word[i] = static_cast<std::uint32_t>(size_of(a) >> 32 * i);
        r.size = 4;
        r.sign = sign_of(a);
        r.trim();
        return r;
    }
};

}  // namespace wive
