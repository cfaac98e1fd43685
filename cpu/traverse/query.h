// Queries for one hit per ray: what is kept of the hits that triangle tests offer.
#pragma once

#include <bit>
#include <cassert>
#include <cstring>
#include <limits>
#include <type_traits>

#include "core/interval.h"
#include "core/ray.h"
#include "traverse/concepts.h"

namespace wive::WIVE_ISA {

// Query::InFlight is the variant for rays in flight, branch-free if that differs: there a misprediction also discards
// work already issued for other rays. For a single ray the branch is faster.

// A hit as four words side by side.
template <class Real>
struct alignas(4 * sizeof(Real)) HitWords {
    using Word = std::conditional_t<sizeof(Real) == sizeof(float), std::uint32_t, std::uint64_t>;

    Real t, u, v;
    Word prim;

    // Replaces this hit by another if that is better, without a branch. Returns the t that is kept, so that it need not
    // be loaded again.
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

// The closest hit in [tmin, tmax]; among hits at the same t the lowest prim, in whatever order they are found.
template <class Real, bool in_flight = false>
struct ClosestHit {
    using InFlight = ClosestHit<Real, true>;
    static constexpr bool in_order = true;
    static constexpr bool crossings = false;
    static constexpr bool wants_uv = true;

    Interval<Real> interval;  // ends at the best hit
    HitWords<Real> best;

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
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real unscale) const {
        const bool hit = best.prim != no_prim;
        constexpr Real nan = std::numeric_limits<Real>::quiet_NaN();
        hits.t[i] = hit ? best.t / unscale : std::numeric_limits<Real>::infinity();
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
    static constexpr bool in_order = false;  // cheaper, and fewer steps: the builder puts likely occluders last
    static constexpr bool crossings = false;
    static constexpr bool wants_uv = false;

    Interval<Real> interval{};
    bool hit = false;

    [[gnu::always_inline]] bool take(unsigned hits) { return hit |= hits != 0; }
    [[gnu::always_inline]] void write(const HitBatch<Real>& hits, std::size_t i, Real) const { hits.occluded[i] = hit; }
};

// Offers the hits in the lanes of a mask; true once the query is done. A query that only counts them takes all at once:
// for rays that leave a surface, a branch per hit on whether it lies in the interval is mispredicted half of the time.
template <class I, class Block, class Real, OfferedQuery<Real> Query>
[[gnu::always_inline]] inline bool offer_lanes(const Block& block, unsigned hit_mask, const Real (&ts)[4],
                                               const Real (&us)[4], const Real (&vs)[4], Query& query) {
    if constexpr (CountingQuery<Query>) {
        using Real4 = typename I::Real4;
        const Real4 t = Real4::load(ts), tmin = Real4::all(query.interval.tmin), tmax = Real4::all(query.interval.tmax);
        return query.take(static_cast<unsigned>(std::popcount(hit_mask & less_equal(tmin, t) & less_equal(t, tmax))));
    } else {
        for (; hit_mask != 0; hit_mask &= hit_mask - 1) {
            const int lane = __builtin_ctz(hit_mask);
            assert(lane < block_width && block.prim_at(lane) >= 0);
            if (query.offer(ts[lane], us[lane], vs[lane], static_cast<std::uint32_t>(block.prim_at(lane)))) return true;
        }
        return false;
    }
}

}  // namespace wive::WIVE_ISA
