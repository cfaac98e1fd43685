// Vectors of four and eight floats and of four doubles, for AVX2 and AVX-512; concepts.h says what each function does.
// Every function is always inlined, so that no copy compiled for one instruction set can be linked into another.
#pragma once

#include <immintrin.h>

#include <cstdint>

#include "core/layout.h"

#define WIVE_INLINE [[gnu::always_inline]] inline

namespace wive::WIVE_ISA {

struct SseFloat4;

struct AvxDouble4 {
    __m256d v;

    WIVE_INLINE static AvxDouble4 load(const double* p) { return {_mm256_load_pd(p)}; }
    WIVE_INLINE static AvxDouble4 set(double x, double y, double z, double w) { return {_mm256_setr_pd(x, y, z, w)}; }
    WIVE_INLINE static AvxDouble4 of(SseFloat4 a);
    WIVE_INLINE void store(double* p) const { _mm256_store_pd(p, v); }
    WIVE_INLINE static AvxDouble4 all(double x) { return {_mm256_set1_pd(x)}; }
    WIVE_INLINE friend AvxDouble4 operator+(AvxDouble4 a, AvxDouble4 b) { return {_mm256_add_pd(a.v, b.v)}; }
    WIVE_INLINE friend AvxDouble4 operator-(AvxDouble4 a, AvxDouble4 b) { return {_mm256_sub_pd(a.v, b.v)}; }
    WIVE_INLINE friend AvxDouble4 operator*(AvxDouble4 a, AvxDouble4 b) { return {_mm256_mul_pd(a.v, b.v)}; }
    WIVE_INLINE friend AvxDouble4 operator/(AvxDouble4 a, AvxDouble4 b) { return {_mm256_div_pd(a.v, b.v)}; }
    WIVE_INLINE friend AvxDouble4 min(AvxDouble4 a, AvxDouble4 b) { return {_mm256_min_pd(a.v, b.v)}; }
    WIVE_INLINE friend AvxDouble4 max(AvxDouble4 a, AvxDouble4 b) { return {_mm256_max_pd(a.v, b.v)}; }
    WIVE_INLINE friend AvxDouble4 abs(AvxDouble4 a) { return {_mm256_andnot_pd(_mm256_set1_pd(-0.0), a.v)}; }
    WIVE_INLINE friend AvxDouble4 flip_sign(AvxDouble4 a, AvxDouble4 s) {
        return {_mm256_xor_pd(a.v, _mm256_and_pd(_mm256_set1_pd(-0.0), s.v))};
    }
    WIVE_INLINE friend unsigned less_equal(AvxDouble4 a, AvxDouble4 b) {
        return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(a.v, b.v, _CMP_LE_OQ)));
    }
    WIVE_INLINE friend double highest_lane(AvxDouble4 a) {
        const __m128d pairs = _mm_max_pd(_mm256_castpd256_pd128(a.v), _mm256_extractf128_pd(a.v, 1));
        return _mm_cvtsd_f64(_mm_max_sd(pairs, _mm_unpackhi_pd(pairs, pairs)));
    }
    WIVE_INLINE friend unsigned all_in_order(AvxDouble4 a, AvxDouble4 b, AvxDouble4 c, AvxDouble4 d, AvxDouble4 e,
                                             AvxDouble4 f) {
        const __m256d ab = _mm256_cmp_pd(a.v, b.v, _CMP_LE_OQ), cd = _mm256_cmp_pd(c.v, d.v, _CMP_LE_OQ);
        return static_cast<unsigned>(
            _mm256_movemask_pd(_mm256_and_pd(_mm256_and_pd(ab, cd), _mm256_cmp_pd(e.v, f.v, _CMP_LT_OQ))));
    }
    WIVE_INLINE friend unsigned equal(AvxDouble4 a, AvxDouble4 b) {
        return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(a.v, b.v, _CMP_EQ_OQ)));
    }
    WIVE_INLINE friend unsigned one_sided(AvxDouble4 low, AvxDouble4 high) {
        const __m256d zero = _mm256_setzero_pd();
        return static_cast<unsigned>(_mm256_movemask_pd(
            _mm256_or_pd(_mm256_cmp_pd(low.v, zero, _CMP_GE_OQ), _mm256_cmp_pd(high.v, zero, _CMP_LE_OQ))));
    }
};

struct SseFloat4 {
    __m128 v;

    WIVE_INLINE static SseFloat4 load(const float* p) { return {_mm_load_ps(p)}; }
    WIVE_INLINE static SseFloat4 all(float x) { return {_mm_set1_ps(x)}; }
    WIVE_INLINE static SseFloat4 set(float x, float y, float z, float w) { return {_mm_setr_ps(x, y, z, w)}; }
    WIVE_INLINE void store(float* p) const { _mm_store_ps(p, v); }
    WIVE_INLINE friend SseFloat4 operator+(SseFloat4 a, SseFloat4 b) { return {_mm_add_ps(a.v, b.v)}; }
    WIVE_INLINE friend SseFloat4 operator-(SseFloat4 a, SseFloat4 b) { return {_mm_sub_ps(a.v, b.v)}; }
    WIVE_INLINE friend SseFloat4 operator*(SseFloat4 a, SseFloat4 b) { return {_mm_mul_ps(a.v, b.v)}; }
    WIVE_INLINE friend SseFloat4 operator/(SseFloat4 a, SseFloat4 b) { return {_mm_div_ps(a.v, b.v)}; }
    WIVE_INLINE friend SseFloat4 min(SseFloat4 a, SseFloat4 b) { return {_mm_min_ps(a.v, b.v)}; }
    WIVE_INLINE friend SseFloat4 max(SseFloat4 a, SseFloat4 b) { return {_mm_max_ps(a.v, b.v)}; }
    WIVE_INLINE friend SseFloat4 abs(SseFloat4 a) { return {_mm_andnot_ps(_mm_set1_ps(-0.0f), a.v)}; }
    WIVE_INLINE friend SseFloat4 flip_sign(SseFloat4 a, SseFloat4 s) {
        return {_mm_xor_ps(a.v, _mm_and_ps(_mm_set1_ps(-0.0f), s.v))};
    }
    WIVE_INLINE friend AvxDouble4 widen(SseFloat4 a) { return {_mm256_cvtps_pd(a.v)}; }
    WIVE_INLINE static SseFloat4 narrow(AvxDouble4 a) { return {_mm256_cvtpd_ps(a.v)}; }
    WIVE_INLINE static SseFloat4 narrow(SseFloat4 a) { return a; }
    WIVE_INLINE static SseFloat4 of(SseFloat4 a) { return a; }
    WIVE_INLINE friend float highest_lane(SseFloat4 a) {
        const __m128 pairs = _mm_max_ps(a.v, _mm_movehl_ps(a.v, a.v));
        return _mm_cvtss_f32(_mm_max_ss(pairs, _mm_movehdup_ps(pairs)));
    }
    WIVE_INLINE friend unsigned sign_bits(SseFloat4 a) { return static_cast<unsigned>(_mm_movemask_ps(a.v)); }
    WIVE_INLINE friend unsigned less_equal(SseFloat4 a, SseFloat4 b) {
        return static_cast<unsigned>(_mm_movemask_ps(_mm_cmp_ps(a.v, b.v, _CMP_LE_OQ)));
    }
    WIVE_INLINE friend unsigned less(SseFloat4 a, SseFloat4 b) {
        return static_cast<unsigned>(_mm_movemask_ps(_mm_cmp_ps(a.v, b.v, _CMP_LT_OQ)));
    }
    WIVE_INLINE friend unsigned all_in_order(SseFloat4 a, SseFloat4 b, SseFloat4 c, SseFloat4 d, SseFloat4 e,
                                             SseFloat4 f) {
        const __m128 ab = _mm_cmp_ps(a.v, b.v, _CMP_LE_OQ), cd = _mm_cmp_ps(c.v, d.v, _CMP_LE_OQ);
        return static_cast<unsigned>(_mm_movemask_ps(_mm_and_ps(_mm_and_ps(ab, cd), _mm_cmp_ps(e.v, f.v, _CMP_LT_OQ))));
    }
    WIVE_INLINE friend unsigned equal(SseFloat4 a, SseFloat4 b) {
        return static_cast<unsigned>(_mm_movemask_ps(_mm_cmp_ps(a.v, b.v, _CMP_EQ_OQ)));
    }
    WIVE_INLINE friend unsigned one_sided(SseFloat4 low, SseFloat4 high) {
        const __m128 zero = _mm_setzero_ps();
        return static_cast<unsigned>(
            _mm_movemask_ps(_mm_or_ps(_mm_cmp_ps(low.v, zero, _CMP_GE_OQ), _mm_cmp_ps(high.v, zero, _CMP_LE_OQ))));
    }
};

WIVE_INLINE AvxDouble4 AvxDouble4::of(SseFloat4 a) { return widen(a); }

// Which of eight lanes were hit: all bits of a lane are 1 if it was, else 0.
struct AvxHits {
    __m256 v;
    WIVE_INLINE unsigned bits() const { return static_cast<unsigned>(_mm256_movemask_ps(v)); }
    WIVE_INLINE unsigned count() const { return static_cast<unsigned>(_mm_popcnt_u32(bits())); }
    WIVE_INLINE unsigned first() const { return _tzcnt_u32(bits()); }
    WIVE_INLINE unsigned last() const { return 31 - _lzcnt_u32(bits()); }
    WIVE_INLINE static AvxHits of_child(const std::uint32_t* row, std::uint32_t child) {
        const __m256i children = _mm256_load_si256(reinterpret_cast<const __m256i*>(row));
        return {_mm256_castsi256_ps(_mm256_cmpeq_epi32(children, _mm256_set1_epi32(static_cast<int>(child))))};
    }
    WIVE_INLINE AvxHits without(AvxHits others) const { return {_mm256_andnot_ps(others.v, v)}; }
};

struct AvxFloat8 {
    __m256 v;

    WIVE_INLINE static AvxFloat8 load(const float* p) { return {_mm256_load_ps(p)}; }
    WIVE_INLINE static AvxFloat8 load(const std::uint8_t* p) {
        return {_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p))))};
    }
    WIVE_INLINE static AvxFloat8 all(float x) { return {_mm256_set1_ps(x)}; }
    WIVE_INLINE void store(float* p) const { _mm256_store_ps(p, v); }
    WIVE_INLINE friend AvxFloat8 operator*(AvxFloat8 a, AvxFloat8 b) { return {_mm256_mul_ps(a.v, b.v)}; }
    WIVE_INLINE friend AvxFloat8 multiply_add(AvxFloat8 a, AvxFloat8 b, AvxFloat8 c) {
        return {_mm256_fmadd_ps(a.v, b.v, c.v)};
    }
    WIVE_INLINE friend AvxFloat8 min(AvxFloat8 a, AvxFloat8 b) { return {_mm256_min_ps(a.v, b.v)}; }
    WIVE_INLINE friend AvxFloat8 max(AvxFloat8 a, AvxFloat8 b) { return {_mm256_max_ps(a.v, b.v)}; }
    WIVE_INLINE friend float highest_lane(AvxFloat8 a) {
        return highest_lane(SseFloat4{_mm_max_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1))});
    }
    WIVE_INLINE friend AvxHits hits(AvxFloat8 tnear, AvxFloat8 tfar) {
        return {_mm256_cmp_ps(tnear.v, tfar.v, _CMP_LE_OQ)};
    }
};

// Slots in an octant's order, each in the low three bits of a lane. A permute reads no other bits, so the bits of other
// octants above them need not be masked off.
struct AvxOrder {
    __m256i slots;
    WIVE_INLINE AvxOrder(const std::uint32_t* row, unsigned shift)
        : slots(_mm256_srl_epi32(_mm256_load_si256(reinterpret_cast<const __m256i*>(row)),
                                 _mm_cvtsi32_si128(static_cast<int>(shift)))) {}
    // From lanes of three bytes. The last load reads four bytes past the row.
    WIVE_INLINE AvxOrder(const std::uint8_t (*row)[3], unsigned shift) {
        const auto four_lanes = [&](int lane) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(row + lane)); };
        const __m256i bytes = _mm256_inserti128_si256(_mm256_castsi128_si256(four_lanes(0)), four_lanes(4), 1);
        const __m256i spread =
            _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 2, -1, 3, 4, 5, -1, 6, 7, 8, -1, 9, 10, 11, -1));
        slots = _mm256_srl_epi32(_mm256_shuffle_epi8(bytes, spread), _mm_cvtsi32_si128(static_cast<int>(shift)));
    }
};

// Chooses four of the eight floats at an address, by four bits each of `word` from bit `shift` on.
struct AvxPick {
    __m128i index;
    WIVE_INLINE AvxPick(std::uint32_t word, int shift)
        : index(_mm_srlv_epi32(_mm_set1_epi32(static_cast<int>(word)),
                               _mm_setr_epi32(shift, shift + 4, shift + 8, shift + 12))) {}
    WIVE_INLINE SseFloat4 operator()(const float* p) const {
        return {_mm256_castps256_ps128(_mm256_permutevar8x32_ps(_mm256_loadu_ps(p), _mm256_castsi128_si256(index)))};
    }
};

// The child in the last lane that was hit; at least one must be. Read back from memory, to which the children are
// stored before the boxes are decided: only the lane number depends on the boxes.
WIVE_INLINE std::uint32_t last_hit_child(__m256i children, __m256 hits) {
    alignas(32) std::uint32_t lanes[8];
    _mm256_store_si256(reinterpret_cast<__m256i*>(lanes), children);
    return lanes[31 - _lzcnt_u32(static_cast<unsigned>(_mm256_movemask_ps(hits)))];
}

// What AVX2 and AVX-512 have in common.
struct Avx {
    using Real = float;
    using Real4 = SseFloat4;
    using Float4 = SseFloat4;
    using Double4 = AvxDouble4;

    using Float8 = AvxFloat8;
    using Hits = AvxHits;
    using Order = AvxOrder;
    using Pick = AvxPick;
};

}  // namespace wive::WIVE_ISA
