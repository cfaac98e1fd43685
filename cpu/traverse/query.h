// What a query keeps of the hits it is offered.
#pragma once

#include <bit>
#include <cstring>
#include <limits>
#include <type_traits>

#include "core/interval.h"
#include "core/ray.h"

namespace wive {

// Every query has in_order: whether children are met from front to back, and perturb_edges: whether the number of its
// hits matters, so that a ray must not pass a surface twice where two triangles meet.

// Queries of rays in flight are InFlight ones, where that is another way of the same: a branch that is predicted wrong
// throws away what has been begun for the rays behind. A ray on its own has nothing else to do but to guess.

// A hit as four words side by side.
template <class Real>
struct alignas(4 * sizeof(Real)) Nearest {
    using Word = std::conditional_t<sizeof(Real) == sizeof(float), std::uint32_t, std::uint64_t>;

    Real t, u, v;
    Word prim;

    // Becomes that hit where it is better: no branch. Returns t, which need not be looked up again.
    [[gnu::always_inline]] Real replace_if(bool better, Real hit_t, Real hit_u, Real hit_v, Word hit_prim) {
        typedef Word Words __attribute__((vector_size(4 * sizeof(Word))));
        const Words hit = {std::bit_cast<Word>(hit_t), std::bit_cast<Word>(hit_u), std::bit_cast<Word>(hit_v),
                           hit_prim};
        const Word mask = Word{0} - better;
        Words words;
        std::memcpy(&words, this, sizeof words);
        words ^= (words ^ hit) & mask;
        std::memcpy(this, &words, sizeof words);
        return std::bit_cast<Real>(Word{words[0]});
    }
};

// The nearest hit in [tmin, tmax]; of hits at the same t, the lowest prim, whatever order they are found in.
template <class Real, bool in_flight = false>
struct ClosestHit {
    using InFlight = ClosestHit<Real, true>;
    // Children are met from front to back and kept with their distances, because tmax falls with every hit found.
    static constexpr bool in_order = true;
    static constexpr bool perturb_edges = false;

    Interval<Real> interval;  // ends at the best hit
    Nearest<Real> best;

    [[gnu::always_inline]] ClosestHit(Interval<Real> given = {}) : interval(given), best{given.tmax, 0, 0, no_prim} {}

    [[gnu::always_inline]] bool offer(Real t, Real u, Real v, std::uint32_t prim) {
        if constexpr (in_flight) {
            const bool nearer = (t < interval.tmax) | ((t == interval.tmax) & (prim < best.prim));
            interval.end_at(best.replace_if((t >= interval.tmin) & nearer, t, u, v, prim));
        } else if (t >= interval.tmin && (t < interval.tmax || (t == interval.tmax && prim < best.prim))) {
            interval.end_at(t);
            best = {t, u, v, prim};
        }
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real scale) const {
        const bool hit = best.prim != no_prim;
        constexpr Real nan = std::numeric_limits<Real>::quiet_NaN();
        hits.t[i] = hit ? best.t * scale : std::numeric_limits<Real>::infinity();
        hits.prim[i] = static_cast<std::int32_t>(static_cast<std::uint32_t>(best.prim));
        if (hits.uv) {
            hits.uv[2 * i] = hit ? best.u : nan;
            hits.uv[2 * i + 1] = hit ? best.v : nan;
        }
    }
};

// Whether anything lies in [tmin, tmax].
template <class Real>
struct AnyHit {
    using InFlight = AnyHit;
    // Any hit ends the query, so children are taken as they stand: cheaper, and fewer steps as well.
    static constexpr bool in_order = false;
    static constexpr bool perturb_edges = false;

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

// Offers the hits in some lanes of a block; true once the query is done.
template <class Block, class Real, class Query>
[[gnu::always_inline]] inline bool offer_lanes(const Block& block, unsigned lanes, const Real (&ts)[4],
                                               const Real (&us)[4], const Real (&vs)[4], Query& query) {
    for (; lanes != 0; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        if (query.offer(ts[lane], us[lane], vs[lane], static_cast<std::uint32_t>(block.prim_at(lane)))) return true;
    }
    return false;
}

}  // namespace wive
