// Queries for every hit along a ray: what is kept of the hits that triangle tests offer.
#pragma once

#include "core/interval.h"
#include "core/ray.h"
#include "traverse/hit_list.h"

namespace wive::WIVE_ISA {

// The number of hits in [tmin, tmax]. crossings: see RayQuery in concepts.h.
template <class Real>
struct CountHits {
    using InFlight = CountHits;
    static constexpr bool in_order = false;  // every hit is wanted, and none ends the interval
    static constexpr bool wants_uv = false;

    Interval<Real> interval{};
    bool crossings = true;
    std::int32_t count = 0;

    [[gnu::always_inline]] bool take(unsigned hits) {
        count += static_cast<std::int32_t>(hits);
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real) const { hits.count[i] = count; }
};

// Every hit in [tmin, tmax], appended to the thread's list, and their number.
template <class Real>
struct AllHits {
    using InFlight = AllHits;
    static constexpr bool in_order = false;
    static constexpr bool wants_uv = true;

    Interval<Real> interval{};
    bool crossings = true;
    Real unscale = 1;  // as RayFrame has it
    std::int32_t count = 0;
    std::size_t ray = 0;
    HitList<Real>* found = nullptr;

    [[gnu::always_inline]] bool offer(Real t, Real u, Real v, std::uint32_t prim) {
        if (interval.holds(t)) {
            found->add({ray, t / unscale, u, v, static_cast<std::int32_t>(prim)});
            ++count;
        }
        return false;
    }
    // Takes a hit that is known to lie in the interval; exact tests call this, with t in the caller's units.
    [[gnu::always_inline]] bool accept(Real t, Real u, Real v, std::uint32_t prim) {
        found->add({ray, t, u, v, static_cast<std::int32_t>(prim)});
        ++count;
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real) const { hits.count[i] = count; }
};

}  // namespace wive::WIVE_ISA
