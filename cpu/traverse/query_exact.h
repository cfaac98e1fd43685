// The closest hit in exact mode.
#pragma once

#include <cmath>

#include "core/layout.h"
#include "traverse/exact_hit.h"
#include "traverse/query.h"

namespace wive::WIVE_ISA {

// The distance to boxes at which a ray ends that starts for them at t = start: no t that rounds to tmax lies behind.
// Without a start of their own, the slack of the boxes (frame.h) is larger than this rounding.
inline float exact_box_tmax(float tmax, float start) {
    const double t = tmax;
    return float_above(t + std::fabs(t) * 0x1p-23 - static_cast<double>(start));
}

// t is in the caller's units, the float nearest to the exact value. Rounding preserves order except for making unequal
// values equal, so equal floats are compared exactly, and the best hit's triangle is remembered for that.
template <class Block>
struct ExactClosestHit {
    using InFlight = ExactClosestHit;
    static constexpr bool in_order = true;
    static constexpr bool crossings = false;
    static constexpr bool wants_uv = true;
    static constexpr float lowest = std::numeric_limits<float>::lowest();

    Interval<float> interval{};  // for the boxes, in the frame's units; ends at the best hit
    RoundedHit best{std::numeric_limits<float>::infinity(), 0, 0};
    std::uint32_t prim = no_prim;
    const Block* block = nullptr;
    int lane = 0;

    // Takes a hit that is known to lie in the caller's interval. compare(block, lane): the sign of the exact t of this
    // hit less that of another triangle.
    template <class Frame, class Compare>
    [[gnu::always_inline]] bool accept(const RoundedHit& hit, const Block& hit_block, int hit_lane, const Frame& ray,
                                       const Compare& compare) {
        const auto hit_prim = static_cast<std::uint32_t>(hit_block.prim_at(hit_lane));
        if (prim != no_prim) {
            if (hit.t > best.t) return false;
            if (hit.t == best.t) [[unlikely]] {
                const int order = compare(*block, lane);
                if (order > 0 || (order == 0 && hit_prim > prim)) return false;
            }
        }
        best = hit;
        prim = hit_prim;
        block = &hit_block;
        lane = hit_lane;
        // The slack of the boxes (frame.h) is larger than the rounding of t, unless t is subnormal or, below the lowest
        // float, infinite: then nearer hits are infinite as well, and no box that lies before the lowest float is
        // skipped.
        const float t = hit.t < lowest ? lowest : hit.t;
        const float end = (t + 0x1p-148f) * ray.unscale;
        interval.end_at(ray.box_start == 0 ? end : exact_box_tmax(end, ray.box_start));
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch<float>& hits, std::size_t i, float) const {
        const bool hit = prim != no_prim;
        constexpr float nan = std::numeric_limits<float>::quiet_NaN();
        hits.t[i] = hit ? best.t : std::numeric_limits<float>::infinity();
        hits.prim[i] = static_cast<std::int32_t>(prim);
        if (hits.uv) {
            hits.uv[2 * i] = hit ? best.u : nan;
            hits.uv[2 * i + 1] = hit ? best.v : nan;
        }
    }
};

}  // namespace wive::WIVE_ISA
