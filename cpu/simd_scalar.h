// The same operations in plain C++, for machines with neither AVX2 nor AVX-512 and as the reference for those.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "stack.h"

#ifndef WIVE_INLINE
#define WIVE_INLINE [[gnu::always_inline]] inline
#endif

namespace wive {

template <int width>
struct ScalarFloats {
    float v[width];

    template <class Lane>
    WIVE_INLINE static ScalarFloats each(Lane lane) {
        ScalarFloats r;
        for (int i = 0; i < width; ++i) r.v[i] = lane(i);
        return r;
    }
    WIVE_INLINE static ScalarFloats load(const float* p) {
        return each([&](int i) { return p[i]; });
    }
    WIVE_INLINE static ScalarFloats all(float x) {
        return each([&](int) { return x; });
    }
    WIVE_INLINE static ScalarFloats set(float x, float y, float z, float w) { return {{x, y, z, w}}; }
    WIVE_INLINE void store(float* p) const {
        for (int i = 0; i < width; ++i) p[i] = v[i];
    }
    WIVE_INLINE friend ScalarFloats operator+(ScalarFloats a, ScalarFloats b) {
        return each([&](int i) { return a.v[i] + b.v[i]; });
    }
    WIVE_INLINE friend ScalarFloats operator-(ScalarFloats a, ScalarFloats b) {
        return each([&](int i) { return a.v[i] - b.v[i]; });
    }
    WIVE_INLINE friend ScalarFloats operator*(ScalarFloats a, ScalarFloats b) {
        return each([&](int i) { return a.v[i] * b.v[i]; });
    }
    WIVE_INLINE friend ScalarFloats operator/(ScalarFloats a, ScalarFloats b) {
        return each([&](int i) { return a.v[i] / b.v[i]; });
    }
    WIVE_INLINE friend ScalarFloats multiply_add(ScalarFloats a, ScalarFloats b, ScalarFloats c) { return a * b + c; }
    WIVE_INLINE friend ScalarFloats min(ScalarFloats a, ScalarFloats b) {
        return each([&](int i) { return a.v[i] < b.v[i] ? a.v[i] : b.v[i]; });
    }
    WIVE_INLINE friend ScalarFloats max(ScalarFloats a, ScalarFloats b) {
        return each([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
    }
    WIVE_INLINE friend ScalarFloats abs(ScalarFloats a) {
        return each([&](int i) { return std::fabs(a.v[i]); });
    }
    WIVE_INLINE friend ScalarFloats flip_sign(ScalarFloats a, ScalarFloats s) {
        return each([&](int i) { return std::signbit(s.v[i]) ? -a.v[i] : a.v[i]; });
    }
    WIVE_INLINE friend float highest_lane(ScalarFloats a) {
        float highest = a.v[0];
        for (int i = 1; i < width; ++i) highest = highest < a.v[i] ? a.v[i] : highest;
        return highest;
    }
    WIVE_INLINE friend unsigned sign_bits(ScalarFloats a) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i) bits |= static_cast<unsigned>(std::signbit(a.v[i])) << i;
        return bits;
    }
    WIVE_INLINE friend unsigned less_equal(ScalarFloats a, ScalarFloats b) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i) bits |= static_cast<unsigned>(a.v[i] <= b.v[i]) << i;
        return bits;
    }
    WIVE_INLINE friend unsigned one_sided(ScalarFloats low, ScalarFloats high) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i) bits |= static_cast<unsigned>((low.v[i] >= 0) | (high.v[i] <= 0)) << i;
        return bits;
    }
};

struct Scalar {
    using Float4 = ScalarFloats<4>;
    using Float8 = ScalarFloats<8>;

    struct Order {
        const std::uint32_t* row;
        unsigned shift;
        WIVE_INLINE unsigned slot(int i) const { return row[i] >> shift & 7u; }
    };

    // Stores the children that hit, in order, at `top` and beyond; returns how many.
    WIVE_INLINE static unsigned store_hits(const Stack::Top& top, Order order, const Float8& tnear, const Float8& tfar,
                                           const std::uint32_t* child) {
        unsigned count = 0;
        for (int i = 0; i < node_width; ++i) {  // always store, step on where it hit: no branch on the hit
            const unsigned slot = order.slot(i);
            top.distance(count) = tnear.v[slot];
            top.child(count) = child[slot];
            count += tnear.v[slot] <= tfar.v[slot];
        }
        return count;
    }

    // As Avx512::push.
    template <bool with_distances>
    WIVE_INLINE static std::uint32_t push(Stack::Top& top, Order order, const Float8& tnear, const Float8& tfar,
                                          const std::uint32_t* child) {
        top.move(static_cast<std::ptrdiff_t>(store_hits(top, order, tnear, tfar, child)) - 1);
        return top.child();
    }
};

// Scalar with the children sorted by true entry distance instead of the stored order: what sorting would buy.
struct ScalarByDistance : Scalar {
    template <bool with_distances>
    WIVE_INLINE static std::uint32_t push(Stack::Top& top, Order order, const Float8& tnear, const Float8& tfar,
                                          const std::uint32_t* child) {
        const unsigned count = store_hits(top, order, tnear, tfar, child);
        for (unsigned i = 1; i < count; ++i) {
            for (unsigned k = i; k > 0 && top.distance(k - 1) < top.distance(k); --k) {
                std::swap(top.distance(k - 1), top.distance(k));
                std::swap(top.child(k - 1), top.child(k));
            }
        }
        top.move(static_cast<std::ptrdiff_t>(count) - 1);
        return top.child();
    }
};

}  // namespace wive
