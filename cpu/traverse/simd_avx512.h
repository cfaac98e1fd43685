// AVX-512, whose compress WiVe is made for.
#pragma once

#include "traverse/concepts.h"
#include "traverse/simd_avx.h"
#include "traverse/stack.h"

namespace wive::WIVE_ISA {

struct Avx512 : Avx {
    template <bool in_order>
    struct Lanes {
        __m256i children;
        __m256 hits, distances;

        WIVE_INLINE Lanes(Order order, Hits by_slot, Float8 tnear, const std::uint32_t* child)
            : children(_mm256_load_si256(reinterpret_cast<const __m256i*>(child))),
              hits(by_slot.v),
              distances(tnear.v) {
            if constexpr (in_order) {
                children = _mm256_permutevar8x32_epi32(children, order.slots);
                hits = _mm256_permutevar8x32_ps(hits, order.slots);
                distances = _mm256_permutevar8x32_ps(distances, order.slots);
            }
        }
        // Compresses in registers and stores whole vectors: compressing to memory is microcoded on some machines.
        WIVE_INLINE void compress_to(Stack::Top top) const {
            const __mmask8 mask = _mm256_movepi32_mask(_mm256_castps_si256(hits));
            if constexpr (in_order) _mm256_storeu_ps(&top.distance(), _mm256_maskz_compress_ps(mask, distances));
            _mm256_storeu_si256(reinterpret_cast<__m256i*>(&top.child()), _mm256_maskz_compress_epi32(mask, children));
        }
        WIVE_INLINE std::uint32_t last_hit() const { return last_hit_child(children, hits); }
    };
};
static_assert(Isa<Avx512>);

using ThisIsa = Avx512;

}  // namespace wive::WIVE_ISA
