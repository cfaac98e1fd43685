// The same operations in plain C++, for machines with neither AVX2 nor AVX-512 and as the reference for those.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

#if defined(__aarch64__)
#include <arm_neon.h>
#endif

#include "traverse/stack.h"

#ifndef WIVE_INLINE
#define WIVE_INLINE [[gnu::always_inline]] inline
#endif

namespace wive::WIVE_ISA {

// GCC's and Clang's portable vectors, in parts of 16 bytes: SSE2 on x86-64, NEON on Arm. (Loops over the lanes took GCC
// three times as long to compile.)
template <class Number, int width>
struct ScalarLanes {
    using Bits = std::conditional_t<sizeof(Number) == sizeof(std::int32_t), std::int32_t, std::int64_t>;
    static constexpr int part_width = 16 / sizeof(Number), parts = width / part_width;
    typedef Number Part __attribute__((vector_size(16)));
    typedef Bits PartMask __attribute__((vector_size(16)));

    Part part[parts];

    template <class MakePart>
    WIVE_INLINE static ScalarLanes each(MakePart make_part) {
        ScalarLanes r;
#pragma GCC unroll 2
        for (int i = 0; i < parts; ++i) r.part[i] = make_part(i);
        return r;
    }
    // One bit per lane, lane 0 lowest: the sign bit of each.
    template <class MakePart>
    WIVE_INLINE static unsigned sign_mask(MakePart make_part) {
#if defined(__SSE2__)
        unsigned bits = 0;
#pragma GCC unroll 2
        for (int i = 0; i < parts; ++i) {
            const auto part = (PartMask)make_part(i);
            if constexpr (part_width == 4)
                bits |= static_cast<unsigned>(__builtin_ia32_movmskps((__attribute__((vector_size(16))) float)part))
                        << i * part_width;
            else
                bits |= static_cast<unsigned>(__builtin_ia32_movmskpd((__attribute__((vector_size(16))) double)part))
                        << i * part_width;
        }
        return bits;
#else
        // NEON has no such instruction: the lanes' bits are added up, those of all parts at once.
        PartMask bits = {};
#pragma GCC unroll 2
        for (int i = 0; i < parts; ++i)
            bits |= ((PartMask)make_part(i) >> std::numeric_limits<Bits>::digits) & lane_bits(i * part_width);
        return sum(bits);
#endif
    }
    WIVE_INLINE static PartMask lane_bits(int first) {
        if constexpr (part_width == 4)
            return PartMask{1, 2, 4, 8} << first;
        else
            return PartMask{1, 2} << first;
    }
    WIVE_INLINE static unsigned sum(PartMask m) {
#if defined(__aarch64__)
        if constexpr (part_width == 4)
            return static_cast<unsigned>(vaddvq_s32((int32x4_t)m));
        else
            return static_cast<unsigned>(vaddvq_s64((int64x2_t)m));
#else
        Bits total = 0;
        for (int i = 0; i < part_width; ++i) total += m[i];
        return static_cast<unsigned>(total);
#endif
    }
    static constexpr Bits sign_bit = std::numeric_limits<Bits>::min();

    WIVE_INLINE Number lane(int i) const { return part[i / part_width][i % part_width]; }
    WIVE_INLINE static ScalarLanes load(const Number* p) {
        ScalarLanes r;
        __builtin_memcpy(r.part, p, sizeof r.part);
        return r;
    }
    WIVE_INLINE static ScalarLanes load(const std::uint8_t* p) {
        return each([&](int i) {
            const std::uint8_t* q = p + i * part_width;
            return __builtin_convertvector(PartMask{q[0], q[1], q[2], q[3]}, Part);
        });
    }
    WIVE_INLINE static ScalarLanes all(Number x) {
        if constexpr (part_width == 4)
            return each([&](int) { return Part{x, x, x, x}; });
        else
            return each([&](int) { return Part{x, x}; });
    }
    WIVE_INLINE static ScalarLanes set(Number x, Number y, Number z, Number w) {
        if constexpr (parts == 1)
            return {{Part{x, y, z, w}}};
        else
            return {{Part{x, y}, Part{z, w}}};
    }
    WIVE_INLINE void store(Number* p) const { __builtin_memcpy(p, part, sizeof part); }
    WIVE_INLINE friend ScalarLanes operator+(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.part[i] + b.part[i]; });
    }
    WIVE_INLINE friend ScalarLanes operator-(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.part[i] - b.part[i]; });
    }
    WIVE_INLINE friend ScalarLanes operator*(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.part[i] * b.part[i]; });
    }
    WIVE_INLINE friend ScalarLanes operator/(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.part[i] / b.part[i]; });
    }
    WIVE_INLINE friend ScalarLanes multiply_add(ScalarLanes a, ScalarLanes b, ScalarLanes c) {
#if defined(__aarch64__)
        return each([&](int i) {
            if constexpr (part_width == 4)
                return (Part)vfmaq_f32((float32x4_t)c.part[i], (float32x4_t)a.part[i], (float32x4_t)b.part[i]);
            else
                return (Part)vfmaq_f64((float64x2_t)c.part[i], (float64x2_t)a.part[i], (float64x2_t)b.part[i]);
        });
#else
        return a * b + c;
#endif
    }
    WIVE_INLINE friend ScalarLanes min(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.part[i] < b.part[i] ? a.part[i] : b.part[i]; });
    }
    WIVE_INLINE friend ScalarLanes max(ScalarLanes a, ScalarLanes b) {
        return each([&](int i) { return a.part[i] > b.part[i] ? a.part[i] : b.part[i]; });
    }
    WIVE_INLINE friend ScalarLanes abs(ScalarLanes a) {
        return each([&](int i) { return (Part)((PartMask)a.part[i] & ~sign_bit); });
    }
    WIVE_INLINE friend ScalarLanes flip_sign(ScalarLanes a, ScalarLanes s) {
        return each([&](int i) { return (Part)((PartMask)a.part[i] ^ ((PartMask)s.part[i] & sign_bit)); });
    }
    WIVE_INLINE friend Number highest_lane(ScalarLanes a) {
        Number highest = a.lane(0);
#pragma GCC unroll 8
        for (int i = 1; i < width; ++i) highest = highest < a.lane(i) ? a.lane(i) : highest;
        return highest;
    }
    WIVE_INLINE friend unsigned sign_bits(ScalarLanes a) {
        return sign_mask([&](int i) { return a.part[i]; });
    }
    WIVE_INLINE friend unsigned less_equal(ScalarLanes a, ScalarLanes b) {
        return sign_mask([&](int i) { return a.part[i] <= b.part[i]; });
    }
    WIVE_INLINE friend unsigned less(ScalarLanes a, ScalarLanes b) {
        return sign_mask([&](int i) { return a.part[i] < b.part[i]; });
    }
    WIVE_INLINE friend unsigned equal(ScalarLanes a, ScalarLanes b) {
        return sign_mask([&](int i) { return a.part[i] == b.part[i]; });
    }
    WIVE_INLINE friend unsigned all_in_order(ScalarLanes a, ScalarLanes b, ScalarLanes c, ScalarLanes d, ScalarLanes e,
                                             ScalarLanes f) {
        return sign_mask(
            [&](int i) { return (a.part[i] <= b.part[i]) & (c.part[i] <= d.part[i]) & (e.part[i] < f.part[i]); });
    }
    WIVE_INLINE friend unsigned one_sided(ScalarLanes low, ScalarLanes high) {
        return sign_mask([&](int i) { return (low.part[i] >= Part{}) | (high.part[i] <= Part{}); });
    }
    WIVE_INLINE friend ScalarLanes<double, width> widen(ScalarLanes a) { return ScalarLanes<double, width>::of(a); }
    // From either precision: to float, and to this one.
    WIVE_INLINE static ScalarLanes narrow(const auto& a) {
        return set(static_cast<Number>(a.lane(0)), static_cast<Number>(a.lane(1)), static_cast<Number>(a.lane(2)),
                   static_cast<Number>(a.lane(3)));
    }
    WIVE_INLINE static ScalarLanes of(const ScalarLanes<float, width>& a) { return narrow(a); }
};

// Which of eight lanes were hit (HitLanes in concepts.h).
struct ScalarHits {
    unsigned mask;
    WIVE_INLINE unsigned bits() const { return mask; }
    WIVE_INLINE unsigned count() const { return static_cast<unsigned>(__builtin_popcount(mask)); }
    WIVE_INLINE unsigned first() const { return static_cast<unsigned>(__builtin_ctz(mask)); }
    WIVE_INLINE unsigned last() const { return 31 - static_cast<unsigned>(__builtin_clz(mask)); }
    WIVE_INLINE static ScalarHits of_child(const std::uint32_t* row, std::uint32_t child) {
        unsigned lanes = 0;
#pragma GCC unroll 8
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
#pragma GCC unroll 8
            for (int i = 0; i < node_width; ++i) slots[i] = row[i] >> shift & 7u;
        }
        WIVE_INLINE Order(const std::uint8_t (*row)[3], unsigned shift) {
#pragma GCC unroll 8
            for (int i = 0; i < node_width; ++i) {
                const std::uint32_t lane = row[i][0] | std::uint32_t{row[i][1]} << 8 | std::uint32_t{row[i][2]} << 16;
                slots[i] = lane >> shift & 7u;
            }
        }
        WIVE_INLINE unsigned slot(int i) const { return slots[i]; }
    };

    // Chooses four of the eight floats at an address, by four bits each of `word` from bit `shift` on.
    struct Pick {
        std::uint32_t index;
        WIVE_INLINE Pick(std::uint32_t word, int shift) : index(word >> shift) {}
        WIVE_INLINE Float4 operator()(const float* p) const {
            return Float4::set(p[index & 7u], p[index >> 4 & 7u], p[index >> 8 & 7u], p[index >> 12 & 7u]);
        }
    };

    using Hits = ScalarHits;

    // Children and distances of one node (CompressedChildren in concepts.h).
    template <bool in_order>
    struct Lanes {
        Hits by_slot;
        alignas(16) float tnear[node_width];
        const std::uint32_t* child;
        unsigned slots[node_width];

        WIVE_INLINE Lanes(const Order& order, Hits hit, const Float8& distances, const std::uint32_t* children)
            : by_slot(hit), child(children) {
            distances.store(tnear);
#pragma GCC unroll 8
            for (int i = 0; i < node_width; ++i) slots[i] = in_order ? order.slot(i) : static_cast<unsigned>(i);
        }
        WIVE_INLINE void compress_to(Stack::Top top) const {
#pragma GCC unroll 8
            for (const unsigned slot : slots) {  // always store, step on where it hit: no branch on the hit
                top.distance() = tnear[slot];
                top.child() = child[slot];
                top.move(by_slot.mask >> slot & 1u);
            }
        }
        WIVE_INLINE std::uint32_t last_hit() const {
            int i = node_width - 1;
            while (i > 0 && !(by_slot.mask >> slots[i] & 1u)) --i;
            return child[slots[i]];
        }
    };
};

using ThisIsa = Scalar;

}  // namespace wive::WIVE_ISA
