// A batch of rays over threads.
#pragma once

#include <cstddef>

#include "kernels.h"

namespace wive {

// Traces rays [0, count) of the batch. threads 0: every core; in_flight 0: chosen by the batch.
void trace(const KernelTable& table, TraceBatch kernel, const BvhView& bvh, const RayBatch& rays, const HitBatch& hits,
           std::size_t count, unsigned threads, unsigned in_flight);

}  // namespace wive
