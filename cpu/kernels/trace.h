// A batch of rays over threads.
#pragma once

#include <cstddef>

#include "kernels/kernels.h"

namespace wive {

// The threads that a batch of `count` rays is worth. threads 0: every core.
unsigned worker_count(std::size_t count, unsigned threads);

// Traces rays [0, count) of the batch. threads 0: every core; in_flight 0: chosen by the batch.
// hits.found: null, or as many lists as workers.
template <class Real>
void trace(const KernelTable<Real>& table, TraceBatch<Real> kernel, const BvhView& bvh, const RayBatch<Real>& rays,
           const HitBatch<Real>& hits, std::size_t count, unsigned threads, unsigned in_flight);

}  // namespace wive
