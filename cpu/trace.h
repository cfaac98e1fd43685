// A batch of rays over threads.
#pragma once

#include <cstddef>

#include "kernels.h"

namespace wive {

// The threads that a batch of `count` rays is worth. threads 0: every core.
unsigned worker_count(std::size_t count, unsigned threads);

// Traces rays [0, count) of the batch. threads 0: every core; in_flight 0: chosen by the batch.
// hits.found: null, or as many lists as workers.
void trace(const KernelTable& table, TraceBatch kernel, const BvhView& bvh, const RayBatch& rays, const HitBatch& hits,
           std::size_t count, unsigned threads, unsigned in_flight);

}  // namespace wive
