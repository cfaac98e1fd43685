// Traces a batch of rays on several threads.
#pragma once

#include <cstddef>

#include "kernels/kernels.h"

namespace wive {

// The number of threads for a batch of `count` rays. threads 0: every core.
unsigned worker_count(std::size_t count, unsigned threads);

// Traces rays [0, count) of the batch. threads 0: every core; in_flight 0: chosen by the size of the batch.
// hits.found: null, or worker_count(count, threads) lists.
template <class Real>
void trace(const KernelTable<Real>& table, TraceBatch<Real> kernel, const BvhView& bvh, const RayBatch<Real>& rays,
           const HitBatch<Real>& hits, std::size_t count, unsigned threads, unsigned in_flight);

}  // namespace wive
