// What a query keeps of the hits it is offered.
#pragma once

#include <limits>

#include "interval.h"
#include "ray.h"

namespace wive {

// Every query has in_order: whether children are met from front to back, and crossings: whether the number of its
// hits matters, so that a ray must not pass a surface twice where two triangles meet.

// The nearest hit in [tmin, tmax]; of hits at the same t, the lowest prim, whatever order they are found in.
template <class Real>
struct ClosestHit {
    // Children are met from front to back and kept with their distances, because tmax falls with every hit found.
    static constexpr bool in_order = true;
    static constexpr bool crossings = false;

    Interval<Real> interval{};  // ends at the best hit
    Real u = 0, v = 0;
    std::uint32_t prim = no_prim;

    [[gnu::always_inline]] bool offer(Real t, Real hit_u, Real hit_v, std::uint32_t hit_prim) {
        if (t >= interval.tmin && (t < interval.tmax || (t == interval.tmax && hit_prim < prim))) {
            interval.end_at(t);
            u = hit_u;
            v = hit_v;
            prim = hit_prim;
        }
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real scale) const {
        const bool hit = prim != no_prim;
        constexpr Real nan = std::numeric_limits<Real>::quiet_NaN();
        hits.t[i] = hit ? interval.tmax * scale : std::numeric_limits<Real>::infinity();
        hits.prim[i] = static_cast<std::int32_t>(prim);
        if (hits.uv) {
            hits.uv[2 * i] = hit ? u : nan;
            hits.uv[2 * i + 1] = hit ? v : nan;
        }
    }
};

// Whether anything lies in [tmin, tmax].
template <class Real>
struct AnyHit {
    // Any hit ends the query, so children are taken as they stand: cheaper, and fewer steps as well.
    static constexpr bool in_order = false;
    static constexpr bool crossings = false;

    Interval<Real> interval{};
    bool hit = false;

    [[gnu::always_inline]] bool offer(Real t, Real, Real, std::uint32_t) {
        hit = interval.holds(t);
        return hit;
    }
    // A hit that is known to lie within, t in the caller's units, as exact mode has it.
    static constexpr bool wants_uv = false;
    [[gnu::always_inline]] bool take(Real, Real, Real, std::uint32_t) { return hit = true; }
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real) const { hits.occluded[i] = hit; }
};

}  // namespace wive
