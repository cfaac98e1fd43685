// AVX2 wrapper types. AVX2 has no compress: a permute by an index looked up from the hit mask stands in for it.
#pragma once

#include <array>

#include "simd_sse.h"
#include "stack.h"

namespace wive {

// For each mask of eight lanes, the lanes that are set, lowest first, four bits each: 1 KB.
inline constexpr std::array<std::uint32_t, 256> compress_table = [] {
    std::array<std::uint32_t, 256> table{};
    for (unsigned mask = 0; mask < 256; ++mask)
        for (unsigned lane = 0, place = 0; lane < 8; ++lane)
            if (mask >> lane & 1u) table[mask] |= lane << 4 * place++;
    return table;
}();

struct Avx2 {
    using Float4 = SseFloat4;
    using Double4 = AvxDouble4;

    using Hits = AvxHits;

    struct Float8 {
        __m256 v;

        WIVE_INLINE static Float8 load(const float* p) { return {_mm256_load_ps(p)}; }
        WIVE_INLINE static Float8 all(float x) { return {_mm256_set1_ps(x)}; }
        WIVE_INLINE friend Float8 multiply_add(Float8 a, Float8 b, Float8 c) { return {_mm256_fmadd_ps(a.v, b.v, c.v)}; }
        WIVE_INLINE friend Float8 min(Float8 a, Float8 b) { return {_mm256_min_ps(a.v, b.v)}; }
        WIVE_INLINE friend Float8 max(Float8 a, Float8 b) { return {_mm256_max_ps(a.v, b.v)}; }
        WIVE_INLINE friend Hits hits(Float8 tnear, Float8 tfar) { return {_mm256_cmp_ps(tnear.v, tfar.v, _CMP_LE_OQ)}; }
    };

    struct Order {
        __m256i slots;
        WIVE_INLINE Order(const std::uint32_t* row, unsigned shift)
            : slots(_mm256_srl_epi32(_mm256_load_si256(reinterpret_cast<const __m256i*>(row)),
                                     _mm_cvtsi32_si128(static_cast<int>(shift)))) {}
    };

    // As Avx512::Lanes.
    template <bool in_order>
    struct Lanes {
        __m256i children;
        __m256 hits, distances;
        Order order;

        WIVE_INLINE Lanes(Order in, Hits by_slot, Float8 tnear, const std::uint32_t* child)
            : children(_mm256_load_si256(reinterpret_cast<const __m256i*>(child))),
              hits(by_slot.v),
              distances(tnear.v),
              order(in) {
            if constexpr (in_order) {
                children = _mm256_permutevar8x32_epi32(children, order.slots);
                hits = _mm256_permutevar8x32_ps(hits, order.slots);
            }
        }
        WIVE_INLINE void compress_to(Stack::Top top) const {
            const unsigned mask = static_cast<unsigned>(_mm256_movemask_ps(hits));
            const __m256i packed = _mm256_set1_epi32(static_cast<int>(compress_table[mask]));
            const __m256i lanes = _mm256_srlv_epi32(packed, _mm256_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28));
            if constexpr (in_order)
                _mm256_storeu_ps(&top.distance(),
                                 _mm256_permutevar8x32_ps(distances, _mm256_permutevar8x32_epi32(order.slots, lanes)));
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(&top.child()), _mm256_permutevar8x32_epi32(children, lanes));
        }
        WIVE_INLINE std::uint32_t last_hit() const { return last_hit_child(children, hits); }
    };
};

}  // namespace wive
