// The paper's half form: entry and exit distances side by side in one register of sixteen lanes.
#pragma once

#include "core/layout.h"
#include "traverse/frame.h"
#include "traverse/simd_avx512.h"
#include "traverse/slabs.h"

namespace wive::WIVE_ISA {

// The upper half holds exit distances negated, so that one max serves both halves. Negating the reciprocal and the bias
// of the far planes negates their distances.
template <class I>
struct HalfSlabs {
    using Layout = Float32Layout<float>;
    using Node = wive::Node;

    __m512 rdir[3], bias[3];
    __m512 tmin_and_tmax;
    std::size_t near_row[3], far_row[3];  // in planes from the node's first
    unsigned order_shift;

    WIVE_INLINE explicit HalfSlabs(const RayFrame<I>& ray) : HalfSlabs(ray, ray) {}
    // octant: the ray's OctantRows, or a frame.
    WIVE_INLINE HalfSlabs(const RayFrame<I>& ray, const auto& octant)
        : tmin_and_tmax(both(ray.interval.tmin, -ray.interval.tmax)) {
        for (unsigned axis = 0; axis < 3; ++axis) {
            rdir[axis] = both(ray.rdir[axis], -ray.rdir[axis]);
            bias[axis] = both(ray.near_bias[axis], -ray.far_bias[axis]);
            near_row[axis] = octant.near_row[axis];
            far_row[axis] = octant.far_row[axis];
        }
        order_shift = octant.order_shift;
    }

    WIVE_INLINE typename I::Order order(const Node& node) const { return {node.order, order_shift}; }

    WIVE_INLINE BoxHits<I> test(const Node& node, float tmax) const {
        const auto planes = [&](unsigned axis) {
            const __m512 near_far =
                _mm512_insertf32x8(_mm512_castps256_ps512(_mm256_load_ps(planes_from(node, near_row[axis]))),
                                   _mm256_load_ps(planes_from(node, far_row[axis])), 1);
            return _mm512_fmadd_ps(near_far, rdir[axis], bias[axis]);
        };
        const __m512 interval = _mm512_mask_broadcastss_ps(tmin_and_tmax, 0xff00, _mm_set_ss(-tmax));
        const __m512 t = _mm512_max_ps(_mm512_max_ps(planes(0), planes(1)), _mm512_max_ps(planes(2), interval));
        const AvxFloat8 tnear = {_mm512_castps512_ps256(t)};
        return {tnear, hits(tnear, {_mm256_xor_ps(_mm512_extractf32x8_ps(t, 1), _mm256_set1_ps(-0.0f))})};
    }

private:
    WIVE_INLINE static __m512 both(float low, float high) {
        return _mm512_insertf32x8(_mm512_set1_ps(low), _mm256_set1_ps(high), 1);
    }
};
static_assert(SlabTest<HalfSlabs<Avx512>, Avx512>);

}  // namespace wive::WIVE_ISA
