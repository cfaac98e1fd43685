// Work spread over threads that live for one call: nothing is left running, so a process may fork at any time.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <thread>
#include <vector>

#if defined(__linux__)
#include <sched.h>
#endif

namespace wive {

// As many threads as asked for; 0 is one for each core that this process may run on.
inline unsigned thread_count(unsigned asked) {
    if (asked > 0) return asked;
#if defined(__linux__)
    cpu_set_t cores;
    if (sched_getaffinity(0, sizeof(cores), &cores) == 0) return static_cast<unsigned>(CPU_COUNT(&cores));
#endif
    return std::max(1u, std::thread::hardware_concurrency());
}

// Calls work(i) once for every i in [0, count), on the calling thread and up to threads - 1 more.
// The first exception of any of them is thrown again here, once all have stopped.
template <class Work>
void parallel_for(std::size_t count, unsigned threads, const Work& work) {
    std::atomic<std::size_t> next{0};
    std::atomic<bool> failed{false};
    std::exception_ptr failure;
    auto run = [&] {
        try {
            for (std::size_t i; (i = next.fetch_add(1, std::memory_order_relaxed)) < count;) work(i);
        } catch (...) {
            if (!failed.exchange(true)) failure = std::current_exception();
            next.store(count, std::memory_order_relaxed);
        }
    };
    const std::size_t helpers = std::min<std::size_t>(threads, count) - (count > 0 ? 1 : 0);
    std::vector<std::thread> pool;
    pool.reserve(helpers);
    try {
        while (pool.size() < helpers) pool.emplace_back(run);
    } catch (...) {
        // The machine has no more threads to give: the ones we have do the work.
    }
    run();
    for (std::thread& thread : pool) thread.join();
    if (failure) std::rethrow_exception(failure);
}

// The same in chunks of a fixed size: work(begin, end). Chunks do not depend on the number of threads.
template <class Work>
void parallel_chunks(std::size_t count, std::size_t chunk, unsigned threads, const Work& work) {
    parallel_for((count + chunk - 1) / chunk, threads,
                 [&](std::size_t i) { work(i * chunk, std::min(count, (i + 1) * chunk)); });
}

}  // namespace wive
