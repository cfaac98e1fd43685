// Batches of rays or points on several threads.
#pragma once

#include <algorithm>
#include <cstddef>

#include "core/parallel.h"
#include "core/ray.h"

namespace wive {

// How many threads take [0, count) in runs of this size; requested: 0 is one per core.
inline unsigned worker_count(std::size_t count, std::size_t run, unsigned requested) {
    const std::size_t runs = (count + run - 1) / run;
    return runs <= 1 ? 1 : static_cast<unsigned>(std::min<std::size_t>(runs, thread_count(requested)));
}

// Calls work(worker, source) on so many threads, which take [0, count) in runs from the source. If one of them throws,
// as when the caller ends the work, the others take no more.
template <class Work>
void share_runs(std::size_t count, std::size_t run, unsigned workers, const Work& work) {
    std::size_t next = 0;
    const RaySource source = {&next, count, run};
    parallel_for(workers, workers, [&](std::size_t worker) {
        const ProgressPart loop = ProgressPart::of_loop(&next, count);
        try {
            work(worker, source);
        } catch (...) {
            __atomic_store_n(&next, count, __ATOMIC_RELAXED);
            throw;
        }
    });
}

}  // namespace wive
