// AVX2, which has no compress: instead, a permute whose index is looked up by the hit mask.
#pragma once

#include <array>

#include "traverse/concepts.h"
#include "traverse/simd_avx.h"
#include "traverse/stack.h"

namespace wive::WIVE_ISA {

// The lanes set in each mask of eight, lowest first, in four bits each: 1 KB.
inline constexpr std::array<std::uint32_t, 256> compress_table = [] {
    std::array<std::uint32_t, 256> table{};
    for (unsigned mask = 0; mask < 256; ++mask)
        for (unsigned lane = 0, place = 0; lane < 8; ++lane)
            if (mask >> lane & 1u) table[mask] |= lane << 4 * place++;
    return table;
}();

struct Avx2 : Avx {
    // Distances are permuted once, by the order and the compress together.
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
static_assert(Isa<Avx2>);

using ThisIsa = Avx2;

}  // namespace wive::WIVE_ISA
