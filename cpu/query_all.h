// What queries for everything along a ray keep of the hits they are offered.
#pragma once

#include "hit_list.h"
#include "ray.h"

namespace wive {

// How many triangles a ray meets in [tmin, tmax].
struct CountHits {
    static constexpr bool in_order = false;  // all are wanted, whichever comes first
    static constexpr bool crossings = true;  // how often a ray passes a surface must come out right

    float tmin, tmax;
    std::int32_t count = 0;

    [[gnu::always_inline]] bool offer(float t, float, float, std::uint32_t) {
        count += t >= tmin && t <= tmax;
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch& hits, std::size_t i, float) const { hits.count[i] = count; }
};

// Each of them, added to the thread's list.
struct AllHits {
    static constexpr bool in_order = false;
    static constexpr bool crossings = true;

    float tmin, tmax;
    float scale = 1;
    std::int32_t count = 0;
    std::size_t ray = 0;
    HitList* found = nullptr;

    [[gnu::always_inline]] bool offer(float t, float u, float v, std::uint32_t prim) {
        if (t >= tmin && t <= tmax) {
            found->add({ray, t * scale, u, v, static_cast<std::int32_t>(prim)});
            ++count;
        }
        return false;
    }
    [[gnu::always_inline]] void write(const HitBatch& hits, std::size_t i, float) const { hits.count[i] = count; }
};

}  // namespace wive
