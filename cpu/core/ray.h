// Batches of rays and hits, as kernels read and write them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/poll.h"

namespace wive {

// Rays in flat arrays. tmin and tmax have one value for all rays (stride 0) or one per ray (stride 1).
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

// Output arrays of a query. A null pointer is an output that the query does not write.
template <class Real>
struct HitBatch {
    Real* t = nullptr;               // (n,) infinity on a miss
    std::int32_t* prim = nullptr;    // (n,) -1 on a miss
    Real* uv = nullptr;              // (n, 2) NaN on a miss
    bool* occluded = nullptr;        // (n,) the only output of any-hit queries
    std::int32_t* stats = nullptr;   // (n, 3) inner nodes visited, leaves visited, triangles tested
    std::int32_t* count = nullptr;   // (n,) number of hits, for count and all-hits queries
    bool crossings = true;           // count and all-hits queries: not every triangle touched, see concepts.h
    HitList<Real>* found = nullptr;  // all-hits queries: one list per worker thread of the batch
};

// Hands out the rays of a batch to the threads that trace it, one run of consecutive rays at a time. Between runs, the
// caller is asked whether to go on (poll.h), which may throw.
struct RaySource {
    std::size_t* next;  // shared by the threads: the first ray not yet handed out
    std::size_t count, run;

    [[gnu::always_inline]] bool take(std::size_t& begin, std::size_t& end) const {
        begin = __atomic_fetch_add(next, run, __ATOMIC_RELAXED);
        if (begin >= count) return false;
        end = count - begin < run ? count : begin + run;
        poll_caller();
        return true;
    }
};

// Most rays that one thread interleaves.
inline constexpr int max_in_flight = 64;

// The prim of a miss and of an unused lane; -1 when read as int32.
inline constexpr std::uint32_t no_prim = 0xffffffffu;

}  // namespace wive
