// What queries for everything along a ray keep of the hits they are offered.
#pragma once

#include "core/interval.h"
#include "core/ray.h"
#include "traverse/hit_list.h"

namespace wive {

// How many triangles a ray meets in [tmin, tmax].
template <class Real>
struct CountHits {
    using InFlight = CountHits;
    static constexpr bool in_order = false;      // all are wanted, whichever comes first
    static constexpr bool perturb_edges = true;  // how often a ray passes a surface must come out right

    Interval<Real> interval{};
    std::int32_t count = 0;

    [[gnu::always_inline]] bool offer(Real t, Real, Real, std::uint32_t) {
        count += interval.holds(t);
        return false;
    }
    // A hit that is known to lie within, t in the caller's units, as exact mode has it.
    static constexpr bool wants_uv = false;
    [[gnu::always_inline]] bool take(Real, Real, Real, std::uint32_t) {
        ++count;
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real) const { hits.count[i] = count; }
};

// Each of them, added to the thread's list.
template <class Real>
struct AllHits {
    using InFlight = AllHits;
    static constexpr bool in_order = false;
    static constexpr bool perturb_edges = true;

    Interval<Real> interval{};
    Real scale = 1;
    std::int32_t count = 0;
    std::size_t ray = 0;
    HitList<Real>* found = nullptr;

    [[gnu::always_inline]] bool offer(Real t, Real u, Real v, std::uint32_t prim) {
        if (interval.holds(t)) {
            found->add({ray, t * scale, u, v, static_cast<std::int32_t>(prim)});
            ++count;
        }
        return false;
    }
    static constexpr bool wants_uv = true;
    [[gnu::always_inline]] bool take(Real t, Real u, Real v, std::uint32_t prim) {
        found->add({ray, t, u, v, static_cast<std::int32_t>(prim)});
        ++count;
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real) const { hits.count[i] = count; }
};

}  // namespace wive
