// The AVX-512 kernels with the children sorted by true entry distance instead of the stored order: what sorting would
// cost.
#pragma once

#include "traverse/simd_avx512.h"

namespace wive::WIVE_ISA {

struct ByDistance : Avx512 {
    template <bool in_order>
    struct Lanes : Avx512::Lanes<in_order> {
        WIVE_INLINE Lanes(Order stored, Hits hits, Float8 tnear, const std::uint32_t* child)
            : Avx512::Lanes<in_order>(in_order ? farthest_first(stored, tnear) : stored, hits, tnear, child) {}
    };

private:
    // Slots by falling distance: a bitonic network over eight 64-bit keys, the distance above, the slot below.
    WIVE_INLINE static Order farthest_first(Order order, Float8 tnear) {
        // A float's bits, read as an integer, rise with it; below zero once all bits but the sign are flipped.
        const __m256i bits = _mm256_castps_si256(tnear.v);
        const __m256i rising = _mm256_xor_si256(bits, _mm256_srli_epi32(_mm256_srai_epi32(bits, 31), 1));
        const __m512i slots = _mm512_setr_epi64(0, 1, 2, 3, 4, 5, 6, 7);
        __m512i keys = _mm512_or_si512(_mm512_slli_epi64(_mm512_cvtepi32_epi64(rising), 32), slots);
        // Each stage compares lanes with their partners; the mask says which of the two lanes keeps the larger key.
        keys = keep_larger(keys, exchange<0xb1>(keys), 0b10011001);
        keys = keep_larger(keys, exchange<0x4e>(keys), 0b11000011);
        keys = keep_larger(keys, exchange<0xb1>(keys), 0b10100101);
        keys = keep_larger(keys, _mm512_shuffle_i64x2(keys, keys, 0x4e), 0b00001111);
        keys = keep_larger(keys, exchange<0x4e>(keys), 0b00110011);
        keys = keep_larger(keys, exchange<0xb1>(keys), 0b01010101);
        order.slots = _mm512_cvtepi64_epi32(keys);
        return order;
    }
    // Swaps neighbours (0xb1) or neighbouring pairs (0x4e) within each half.
    template <int pattern>
    WIVE_INLINE static __m512i exchange(__m512i keys) {
        return _mm512_permutex_epi64(keys, pattern);
    }
    WIVE_INLINE static __m512i keep_larger(__m512i a, __m512i b, __mmask8 larger) {
        return _mm512_mask_max_epi64(_mm512_min_epi64(a, b), larger, a, b);
    }
};

}  // namespace wive::WIVE_ISA
