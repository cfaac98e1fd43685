// AVX-512, whose compress WiVe is made for.
#pragma once

#include "traverse/concepts.h"
#include "traverse/simd_avx.h"
#include "traverse/stack.h"

namespace wive {

struct Avx512 : Avx {
    template <bool in_order>
    struct Lanes : Children<in_order> {
        __m256 distances;

        WIVE_INLINE Lanes(Order order, Hits by_slot, Float8 tnear, const std::uint32_t* child)
            : Children<in_order>(order, by_slot, child), distances(tnear.v) {
            if constexpr (in_order) distances = _mm256_permutevar8x32_ps(distances, order.slots);
        }
        // Compresses in registers and stores whole vectors: compressing to memory is microcoded on some machines.
        WIVE_INLINE void compress_to(Stack::Top top) const {
            const __mmask8 mask = _mm256_movepi32_mask(_mm256_castps_si256(this->hits));
            if constexpr (in_order) _mm256_storeu_ps(&top.distance(), _mm256_maskz_compress_ps(mask, distances));
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(&top.child()),
                                _mm256_maskz_compress_epi32(mask, this->children));
        }
    };
};
static_assert(Isa<Avx512>);

}  // namespace wive
