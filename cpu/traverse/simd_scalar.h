// The same operations in plain C++, for machines with neither AVX2 nor AVX-512 and as the reference for those.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "traverse/stack.h"

#ifndef WIVE_INLINE
#define WIVE_INLINE [[gnu::always_inline]] inline
#endif

namespace wive {

template <class Number, int width>
struct ScalarLanes {
    Number v[width];

    template <class Lane>
    WIVE_INLINE static ScalarLanes each(Lane lane) {
        ScalarLanes r;
        for (int i = 0; i < width; ++i) r.v[i] = lane(i);
        return r;
    }
    WIVE_INLINE static ScalarLanes load(const Number* p) {
        return each([&](int i) { return p[i]; });
    }
    WIVE_INLINE static ScalarLanes load(const std::uint8_t* p) {
        return each([&](int i) { return static_cast<Number>(p[i]); });
    }
    WIVE_INLINE static ScalarLanes all(Number x) {
        return each([&](int) { return x; });
    }
    WIVE_INLINE static ScalarLanes set(Number x, Number y, Number z, Number w) { return {{x, y, z, w}}; }
    WIVE_INLINE void store(Number* p) const {
        for (int i = 0; i < width; ++i) p[i] = v[i];
    }
    WIVE_INLINE friend ScalarLanes operator+(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.v[i] + b.v[i]; });
    }
    WIVE_INLINE friend ScalarLanes operator-(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.v[i] - b.v[i]; });
    }
    WIVE_INLINE friend ScalarLanes operator*(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.v[i] * b.v[i]; });
    }
    WIVE_INLINE friend ScalarLanes operator/(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.v[i] / b.v[i]; });
    }
    WIVE_INLINE friend ScalarLanes multiply_add(ScalarLanes a, ScalarLanes b, ScalarLanes c) { return a * b + c; }
    WIVE_INLINE friend ScalarLanes min(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.v[i] < b.v[i] ? a.v[i] : b.v[i]; });
    }
    WIVE_INLINE friend ScalarLanes max(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
    }
    WIVE_INLINE friend ScalarLanes abs(ScalarLanes a) {
        return each([&](int i) { return std::fabs(a.v[i]); });
    }
    WIVE_INLINE friend ScalarLanes flip_sign(ScalarLanes a, ScalarLanes s) {
        return each([&](int i) { return std::signbit(s.v[i]) ? -a.v[i] : a.v[i]; });
    }
    WIVE_INLINE friend Number highest_lane(ScalarLanes a) {
        Number highest = a.v[0];
        for (int i = 1; i < width; ++i) highest = highest < a.v[i] ? a.v[i] : highest;
        return highest;
    }
    WIVE_INLINE friend unsigned sign_bits(ScalarLanes a) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i) bits |= static_cast<unsigned>(std::signbit(a.v[i])) << i;
        return bits;
    }
    WIVE_INLINE friend unsigned less_equal(ScalarLanes a, ScalarLanes b) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i) bits |= static_cast<unsigned>(a.v[i] <= b.v[i]) << i;
        return bits;
    }
    WIVE_INLINE friend unsigned less(ScalarLanes a, ScalarLanes b) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i) bits |= static_cast<unsigned>(a.v[i] < b.v[i]) << i;
        return bits;
    }
    WIVE_INLINE friend unsigned all_in_order(ScalarLanes a, ScalarLanes b, ScalarLanes c, ScalarLanes d, ScalarLanes e,
                                             ScalarLanes f) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i)
            bits |= static_cast<unsigned>(a.v[i] <= b.v[i] && c.v[i] <= d.v[i] && e.v[i] < f.v[i]) << i;
        return bits;
    }
    WIVE_INLINE friend unsigned equal(ScalarLanes a, ScalarLanes b) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i) bits |= static_cast<unsigned>(a.v[i] == b.v[i]) << i;
        return bits;
    }
    WIVE_INLINE friend ScalarLanes<double, width> widen(ScalarLanes a) {
        return ScalarLanes<double, width>::each([&](int i) { return static_cast<double>(a.v[i]); });
    }
    // From either precision: to float, and to this one.
    WIVE_INLINE static ScalarLanes narrow(const auto& a) {
        return each([&](int i) { return static_cast<Number>(a.v[i]); });
    }
    WIVE_INLINE static ScalarLanes of(const ScalarLanes<float, width>& a) {
        return each([&](int i) { return static_cast<Number>(a.v[i]); });
    }
    WIVE_INLINE friend unsigned one_sided(ScalarLanes low, ScalarLanes high) {
        unsigned bits = 0;
        for (int i = 0; i < width; ++i) bits |= static_cast<unsigned>((low.v[i] >= 0) | (high.v[i] <= 0)) << i;
        return bits;
    }
};

// Which of eight lanes were hit. As AvxHits.
struct ScalarHits {
    unsigned mask;
    WIVE_INLINE unsigned bits() const { return mask; }
    WIVE_INLINE unsigned count() const { return static_cast<unsigned>(__builtin_popcount(mask)); }
    WIVE_INLINE unsigned first() const { return static_cast<unsigned>(__builtin_ctz(mask)); }
    WIVE_INLINE unsigned last() const { return 31 - static_cast<unsigned>(__builtin_clz(mask)); }
    WIVE_INLINE static ScalarHits of_child(const std::uint32_t* row, std::uint32_t child) {
        unsigned lanes = 0;
        for (int i = 0; i < node_width; ++i) lanes |= static_cast<unsigned>(row[i] == child) << i;
        return {lanes};
    }
    WIVE_INLINE ScalarHits without(ScalarHits others) const { return {mask & ~others.mask}; }
};
WIVE_INLINE ScalarHits hits(const ScalarLanes<float, 8>& tnear, const ScalarLanes<float, 8>& tfar) {
    return {less_equal(tnear, tfar)};
}

struct Scalar {
    using Real = float;
    using Real4 = ScalarLanes<float, 4>;
    using Float4 = ScalarLanes<float, 4>;
    using Double4 = ScalarLanes<double, 4>;
    using Float8 = ScalarLanes<float, 8>;

    struct Order {
        std::uint32_t slots[node_width];
        WIVE_INLINE Order(const std::uint32_t* row, unsigned shift) {
            for (int i = 0; i < node_width; ++i) slots[i] = row[i] >> shift & 7u;
        }
        WIVE_INLINE Order(const std::uint8_t (*row)[3], unsigned shift) {
            for (int i = 0; i < node_width; ++i) {
                const std::uint32_t lane = row[i][0] | std::uint32_t{row[i][1]} << 8 | std::uint32_t{row[i][2]} << 16;
                slots[i] = lane >> shift & 7u;
            }
        }
        WIVE_INLINE unsigned slot(int i) const { return slots[i]; }
    };

    // As AvxPick.
    struct Pick {
        std::uint32_t index;
        WIVE_INLINE Pick(std::uint32_t word, int shift) : index(word >> shift) {}
        WIVE_INLINE Float4 operator()(const float* p) const {
            return Float4::each([&](int i) { return p[index >> 4 * i & 7u]; });
        }
    };

    using Hits = ScalarHits;

    // As Avx512::Lanes.
    template <bool in_order>
    struct Lanes {
        Hits by_slot;
        const Float8& tnear;
        const std::uint32_t* child;
        unsigned slots[node_width];

        WIVE_INLINE Lanes(const Order& order, Hits hit, const Float8& distances, const std::uint32_t* children)
            : by_slot(hit), tnear(distances), child(children) {
            for (int i = 0; i < node_width; ++i) slots[i] = in_order ? order.slot(i) : static_cast<unsigned>(i);
        }
        WIVE_INLINE void compress_to(Stack::Top top) const {
            for (const unsigned slot : slots) {  // always store, step on where it hit: no branch on the hit
                top.distance() = tnear.v[slot];
                top.child() = child[slot];
                top.move(by_slot.mask >> slot & 1u);
            }
        }
        WIVE_INLINE std::uint32_t last_hit() const {
            int i = node_width - 1;
            while (!(by_slot.mask >> slots[i] & 1u)) --i;
            return child[slots[i]];
        }
    };
};

// Scalar with the children sorted by true entry distance instead of the stored order: what sorting would buy.
struct ScalarByDistance : Scalar {
    template <bool in_order>
    struct Lanes : Scalar::Lanes<in_order> {
        WIVE_INLINE Lanes(const Order& order, Hits hit, const Float8& distances, const std::uint32_t* children)
            : Scalar::Lanes<in_order>(order, hit, distances, children) {
            for (int i = 1; i < node_width; ++i)
                for (int k = i; k > 0 && distances.v[this->slots[k - 1]] < distances.v[this->slots[k]]; --k)
                    std::swap(this->slots[k - 1], this->slots[k]);
        }
    };
};

}  // namespace wive
