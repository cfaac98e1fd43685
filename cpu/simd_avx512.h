// AVX-512 wrapper types: the full form's eight lanes, the half form's sixteen, and the compress that gave them sense.
#pragma once

#include "simd_sse.h"
#include "stack.h"

namespace wive {

struct Avx512 {
    using Float4 = SseFloat4;
    using Double4 = AvxDouble4;

    struct Float8 {
        __m256 v;

        WIVE_INLINE static Float8 load(const float* p) { return {_mm256_load_ps(p)}; }
        WIVE_INLINE static Float8 all(float x) { return {_mm256_set1_ps(x)}; }
        WIVE_INLINE friend Float8 multiply_add(Float8 a, Float8 b, Float8 c) { return {_mm256_fmadd_ps(a.v, b.v, c.v)}; }
        WIVE_INLINE friend Float8 min(Float8 a, Float8 b) { return {_mm256_min_ps(a.v, b.v)}; }
        WIVE_INLINE friend Float8 max(Float8 a, Float8 b) { return {_mm256_max_ps(a.v, b.v)}; }
    };

    // Slots in the octant's order. A permute reads the low three bits of an index, so nothing need be masked.
    struct Order {
        __m256i slots;
        WIVE_INLINE Order(const std::uint32_t* row, unsigned shift)
            : slots(_mm256_srl_epi32(_mm256_load_si256(reinterpret_cast<const __m256i*>(row)),
                                     _mm_cvtsi32_si128(static_cast<int>(shift)))) {}
    };

    // Permutes the lanes into order, compresses those that hit and stores them at `top`, which moves to the last of
    // them, the nearest, or to the entry below where none hit; returns that entry's child.
    //
    // The child would come back from the stack only after compress, store and load. It is taken the short way: the
    // ordered children are stored before the boxes are decided, and the last lane that hit picks one of them.
    // The one branch asks whether anything was hit at all. Without it the next child always waits for this node's
    // boxes; with it, predicted, the processor goes on with what lies below on the stack (docs/design.md).
    template <bool in_order>
    WIVE_INLINE static std::uint32_t push(Stack::Top& top, Order order, Float8 tnear, Float8 tfar,
                                          const std::uint32_t* child) {
        const __m256 hits_by_slot = _mm256_cmp_ps(tnear.v, tfar.v, _CMP_LE_OQ);
        const unsigned count = static_cast<unsigned>(_mm_popcnt_u32(static_cast<unsigned>(_mm256_movemask_ps(hits_by_slot))));
        if (count == 0) {
            top.move(-1);
            return top.child();
        }
        __m256i children = _mm256_load_si256(reinterpret_cast<const __m256i*>(child));
        __m256 hits = hits_by_slot;
        if constexpr (in_order) {
            children = _mm256_permutevar8x32_epi32(children, order.slots);
            hits = _mm256_permutevar8x32_ps(hits, order.slots);
        }
        alignas(32) std::uint32_t next[node_width];
        _mm256_store_si256(reinterpret_cast<__m256i*>(next), children);
        // Compressed in registers and stored whole: compressing straight to memory is microcoded on some machines.
        const __mmask8 lanes = _mm256_movepi32_mask(_mm256_castps_si256(hits));
        if constexpr (in_order)
            _mm256_storeu_ps(&top.distance(),
                             _mm256_maskz_compress_ps(lanes, _mm256_permutevar8x32_ps(tnear.v, order.slots)));
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(&top.child()), _mm256_maskz_compress_epi32(lanes, children));
        top.move(static_cast<std::ptrdiff_t>(count) - 1);
        return next[31 - _lzcnt_u32(static_cast<unsigned>(_mm256_movemask_ps(hits)))];
    }
};

}  // namespace wive
