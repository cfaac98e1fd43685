// All hits along each ray: found in any order by several threads, handed over ray by ray and sorted.
#pragma once

#include <vector>

#include "core/large_array.h"
#include "kernels/trace.h"
#include "traverse/hit_list.h"

namespace wive {

// Where the hits of ray i go: rows [offsets[i], offsets[i + 1]) of each array.
template <class Real>
struct SortedHits {
    const std::int64_t* offsets;  // (n + 1,)
    Real* t;                      // (h,)
    std::int32_t* prim;           // (h,)
    Real* uv;                     // (h, 2)
};

// The hits of one batch. They take 24 bytes each until `sort_into` hands them on, where they take 16 (float64: 40, 28);
// nothing is traced twice.
template <class Real>
class Gathering {
public:
    // Traces rays [0, count) of the batch with a kernel for QueryKind::all. stats: (n, 3), or null.
    Gathering(const KernelTable<Real>& table, TraceBatch<Real> kernel, const BvhView& bvh, const RayBatch<Real>& rays,
              std::size_t count, std::int32_t* stats, unsigned threads, unsigned in_flight);

    // Writes (count + 1,) offsets: where each ray's hits begin and the last one's end.
    void write_offsets(std::int64_t* offsets) const;

    // Moves the hits out, each ray's by ascending t and, where that is equal, by ascending prim.
    void sort_into(const SortedHits<Real>& hits);

private:
    unsigned threads_;
    LargeArray<std::int32_t> counts_;   // of each ray; runs down as they are moved out
    std::vector<HitList<Real>> lists_;  // one a worker
};

}  // namespace wive
