// Rays and hits as the kernels see them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wive {

// Batches are flat arrays. tmin and tmax have one value for all rays (stride 0) or one a ray (stride 1).
template <class Real>
struct RayBatch {
    const Real* origins;     // (n, 3)
    const Real* directions;  // (n, 3)
    const Real* tmin;
    const Real* tmax;
    std::size_t tmin_stride, tmax_stride;
};

template <class Real>
class HitList;

// Where results go; a null pointer is an output nobody asked for.
template <class Real>
struct HitBatch {
    Real* t = nullptr;               // (n,) infinity on a miss
    std::int32_t* prim = nullptr;    // (n,) -1 on a miss
    Real* uv = nullptr;              // (n, 2) NaN on a miss
    bool* occluded = nullptr;        // (n,) any-hit queries write only this
    std::int32_t* stats = nullptr;   // (n, 3) inner nodes, leaves, triangles
    std::int32_t* count = nullptr;   // (n,) hits of each ray, where all are asked for
    HitList<Real>* found = nullptr;  // and the hits themselves: a list for each worker of the batch
};

// Hands out the rays of a batch, a run at a time, to all the threads that trace it.
struct RaySource {
    std::size_t* next;  // shared; the first ray that nobody has taken
    std::size_t count, run;

    [[gnu::always_inline]] bool take(std::size_t& begin, std::size_t& end) const {
        begin = __atomic_fetch_add(next, run, __ATOMIC_RELAXED);
        end = count - begin < run ? count : begin + run;
        return begin < count;
    }
};

inline constexpr int max_in_flight = 64;

inline constexpr std::uint32_t no_prim = 0xffffffffu;

}  // namespace wive
