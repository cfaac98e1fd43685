// AVX-512 wrapper types: the full form's eight lanes, the half form's sixteen, and the compress that gave them sense.
#pragma once

#include "simd_sse.h"
#include "stack.h"

namespace wive {

struct Avx512 {
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

    // Slots in the octant's order. A permute reads the low three bits of an index, so nothing need be masked.
    struct Order {
        __m256i slots;
        WIVE_INLINE Order(const std::uint32_t* row, unsigned shift)
            : slots(_mm256_srl_epi32(_mm256_load_si256(reinterpret_cast<const __m256i*>(row)),
                                     _mm_cvtsi32_si128(static_cast<int>(shift)))) {}
    };

    // Lanes on their way to the stack: children, distances and which of them hit.
    template <bool in_order>
    struct Lanes {
        __m256i children;
        __m256 hits, distances;

        WIVE_INLINE Lanes(Order order, Hits by_slot, Float8 tnear, const std::uint32_t* child)
            : children(_mm256_load_si256(reinterpret_cast<const __m256i*>(child))), hits(by_slot.v), distances(tnear.v) {
            if constexpr (in_order) {
                children = _mm256_permutevar8x32_epi32(children, order.slots);
                hits = _mm256_permutevar8x32_ps(hits, order.slots);
                distances = _mm256_permutevar8x32_ps(distances, order.slots);
            }
        }
        // Compressed in registers and stored whole: compressing straight to memory is microcoded on some machines.
        WIVE_INLINE void compress_to(Stack::Top top) const {
            const __mmask8 mask = _mm256_movepi32_mask(_mm256_castps_si256(hits));
            if constexpr (in_order) _mm256_storeu_ps(&top.distance(), _mm256_maskz_compress_ps(mask, distances));
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(&top.child()), _mm256_maskz_compress_epi32(mask, children));
        }
        WIVE_INLINE std::uint32_t last_hit() const { return last_hit_child(children, hits); }
    };
};

}  // namespace wive
