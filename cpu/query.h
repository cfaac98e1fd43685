// What a query keeps of the hits it is offered.
#pragma once

#include <limits>

#include "ray.h"

namespace wive {

// Every query has in_order: whether children are met from front to back, and crossings: whether the number of its
// hits matters, so that a ray must not pass a surface twice where two triangles meet.

// The nearest hit in [tmin, tmax]; of hits at the same t, the lowest prim, whatever order they are found in.
struct ClosestHit {
    // Children are met from front to back and kept with their distances, because tmax falls with every hit found.
    static constexpr bool in_order = true;
    static constexpr bool crossings = false;

    float tmin, tmax;  // tmax shrinks to the best hit
    float u = 0, v = 0;
    std::uint32_t prim = no_prim;

    [[gnu::always_inline]] bool offer(float t, float hit_u, float hit_v, std::uint32_t hit_prim) {
        if (t >= tmin && (t < tmax || (t == tmax && hit_prim < prim))) {
            tmax = t;
            u = hit_u;
            v = hit_v;
            prim = hit_prim;
        }
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch& hits, std::size_t i, float scale) const {
        const bool hit = prim != no_prim;
        constexpr float nan = std::numeric_limits<float>::quiet_NaN();
        hits.t[i] = hit ? tmax * scale : std::numeric_limits<float>::infinity();
        hits.prim[i] = static_cast<std::int32_t>(prim);
        if (hits.uv) {
            hits.uv[2 * i] = hit ? u : nan;
            hits.uv[2 * i + 1] = hit ? v : nan;
        }
    }
};

// Whether anything lies in [tmin, tmax].
struct AnyHit {
    // Any hit ends the query, so children are taken as they stand: cheaper, and fewer steps as well.
    static constexpr bool in_order = false;
    static constexpr bool crossings = false;

    float tmin, tmax;
    bool hit = false;

    [[gnu::always_inline]] bool offer(float t, float, float, std::uint32_t) {
        hit = t >= tmin && t <= tmax;
        return hit;
    }
    [[gnu::always_inline]] void write(const HitBatch& hits, std::size_t i, float) const { hits.occluded[i] = hit; }
};

}  // namespace wive
