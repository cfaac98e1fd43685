// All hits along each ray: several threads find them in any order; they are returned ray by ray, sorted.
#pragma once

#include <vector>

#include "core/large_array.h"
#include "kernels/trace.h"
#include "traverse/hit_budget.h"
#include "traverse/hit_list.h"

namespace wive {

// Output arrays; the hits of ray i are rows [offsets[i], offsets[i + 1]) of each.
template <class Real>
struct SortedHits {
    const std::int64_t* offsets;  // (n + 1,)
    Real* t;                      // (h,)
    std::int32_t* prim;           // (h,)
    Real* uv;                     // (h, 2)
};

// Collects the hits of one batch, which is traced once. A hit takes 24 bytes here and 16 in the output (float64: 40,
// 28).
template <class Real>
class HitCollector {
public:
    // Traces rays [0, count) of the batch with a kernel for QueryKind::all. crossings: see HitBatch. stats: (n, 3), or
    // null. max_bytes: what the hits may take here, 0 by what memory there is; more is an OutOfMemory while they are
    // found.
    HitCollector(const KernelTable<Real>& table, TraceBatch<Real> kernel, const BvhView& bvh,
                 const RayBatch<Real>& rays, std::size_t count, bool crossings, std::int32_t* stats, unsigned threads,
                 unsigned in_flight, std::size_t max_bytes);

    // Writes (count + 1,) offsets: where each ray's hits begin and the last one's end.
    void write_offsets(std::int64_t* offsets) const;

    // Moves the hits out; those of a ray by ascending t, and at equal t by ascending prim.
    void sort_into(const SortedHits<Real>& hits);

private:
    unsigned threads_;
    HitBudget budget_;
    LargeArray<std::int32_t> counts_;   // hits per ray not yet moved out
    std::vector<HitList<Real>> lists_;  // one per worker
};

}  // namespace wive
