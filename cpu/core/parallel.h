// Loops over several threads. The threads live for one call: none is left running, so a process may fork at any time.
#pragma once

#include <algorithm>
#include <atomic>
#include <cassert>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <mutex>
#include <numeric>
#include <thread>
#include <vector>

#include "core/default_floats.h"
#include "core/memory.h"
#include "core/poll.h"
#include "core/progress.h"
#include "core/thread_count.h"

namespace wive {

// Yields the core until ready(), for 200 us at most. Most waits here are shorter than the system takes to wake a thread
// that sleeps on a condition variable, on virtual cores above all.
template <class Ready>
void yield_until(const Ready& ready) {
    using Clock = std::chrono::steady_clock;
    for (const auto end = Clock::now() + std::chrono::microseconds(200); !ready() && Clock::now() < end;)
        std::this_thread::yield();
}

// The calling thread and up to count - 1 helper threads, started on first use and joined by the destructor. An idle
// helper yields for a while, then sleeps. for_each never waits for a helper that has not begun, so on a busy machine
// the calling thread does the work alone.
class Threads {
public:
    explicit Threads(unsigned count) : count_(count), in_use_(count) { prepare_to_throw(); }
    Threads(const Threads&) = delete;
    Threads& operator=(const Threads&) = delete;
    ~Threads() {
        {
            const std::lock_guard lock(mutex_);
            ending_ = true;
        }
        wake_.notify_all();
        for (std::thread& helper : helpers_) helper.join();
    }

    // Calls work(i) once for every i in [0, count), and asks this thread's caller now and then whether to go on
    // (poll.h). If calls throw, the first exception is thrown again here, after all threads have stopped.
    template <class Work>
    void for_each(std::size_t count, const Work& work) {
        Job job = {count, [](const void* w, std::size_t i) { (*static_cast<const Work*>(w))(i); }, &work};
        const ProgressPart loop = ProgressPart::of_loop(&job.next, count);
        const std::size_t wanted = std::min<std::size_t>(count_, count);
        if (wanted > 1) start(job, wanted - 1);
        job.run();
        if (wanted > 1) finish();
        if (job.failure) std::rethrow_exception(job.failure);
    }

private:
    struct Job {
        std::size_t count;
        void (*call)(const void* work, std::size_t i);
        const void* work;
        std::size_t next = 0;  // shared by the threads
        std::atomic<bool> failed{false};
        std::exception_ptr failure{};

        void run() {
            try {
                for (std::size_t i; (i = __atomic_fetch_add(&next, 1, __ATOMIC_RELAXED)) < count; poll_caller())
                    call(work, i);
            } catch (...) {
                if (!failed.exchange(true)) failure = std::current_exception();
                __atomic_store_n(&next, count, __ATOMIC_RELAXED);
            }
        }
    };

    // Hands the job to the helpers.
    void start(Job& job, std::size_t helpers) {
        try {
            while (helpers_.size() < helpers) helpers_.emplace_back([this] { help(); });
        } catch (...) {
            // The system refused another thread: those that exist do the work.
        }
        if (requests_can_fail()) {  // before this thread takes the memory that they begin with
            std::unique_lock lock(mutex_);
            idle_.wait(lock, [this] { return begun_ == helpers_.size(); });
        }
        {
            const std::lock_guard lock(mutex_);
            job_ = &job;
            ++job_number_;
        }
        wake_.notify_all();
    }

    // Takes the job back and waits for the helpers that have begun.
    void finish() {
        {
            const std::lock_guard lock(mutex_);
            job_ = nullptr;
        }
        yield_until([this] { return working_ == 0; });
        std::unique_lock lock(mutex_);
        idle_.wait(lock, [this] { return working_ == 0; });
    }

    // A helper's loop.
    void help() {
        const DefaultFloats floats;  // not every system lets a new thread inherit its creator's
        {
            const std::lock_guard lock(mutex_);
            ++begun_;
            const bool works = can_throw();
            idle_.notify_one();
            if (!works) return;  // the other threads do the work
        }
        for (std::size_t last = 0;;) {
            yield_until([&] { return ending_ || job_number_ != last; });
            std::unique_lock lock(mutex_);
            if (!job_ && !ending_ && job_number_ != last) {
                // The job ended before this helper began: yield again, until the next.
                last = job_number_;
                continue;
            }
            wake_.wait(lock, [&] { return ending_ || (job_ && job_number_ != last); });
            if (ending_) return;
            last = job_number_;
            Job& job = *job_;
            ++working_;
            lock.unlock();
            job.run();
            lock.lock();
            if (--working_ == 0) idle_.notify_one();
        }
    }

    const unsigned count_;
    const ThreadsInUse in_use_;
    std::vector<std::thread> helpers_;
    std::mutex mutex_;
    std::condition_variable wake_, idle_;
    // Written under the mutex. The atomic ones are read without it while yielding.
    Job* job_ = nullptr;                       // null: no work
    std::size_t begun_ = 0;                    // helpers that run
    std::atomic<std::size_t> job_number_ = 0;  // tells jobs apart, so that a helper takes each once
    std::atomic<unsigned> working_ = 0;
    std::atomic<bool> ending_ = false;
};

template <class Work>
void parallel_for(std::size_t count, Threads& threads, const Work& work) {
    threads.for_each(count, work);
}

// parallel_for on threads that live for this call.
template <class Work>
void parallel_for(std::size_t count, unsigned threads, const Work& work) {
    Threads(threads).for_each(count, work);
}

// Calls work(begin, end) for chunks of a fixed size. The chunks do not depend on the number of threads.
template <class Work>
void parallel_chunks(std::size_t count, std::size_t chunk, Threads& threads, const Work& work) {
    threads.for_each((count + chunk - 1) / chunk,
                     [&](std::size_t i) { work(i * chunk, std::min(count, (i + 1) * chunk)); });
}

// The i-th number of a permutation of [0, count) whose neighbours lie far apart: steps of the golden ratio, 144 / 89
// being consecutive Fibonacci numbers. For work that fills fresh memory: threads that fill adjacent parts of it would
// each clear the same huge page.
inline std::size_t scattered(std::size_t i, std::size_t count) {
    assert(i < count);
    std::size_t step = count * 89 / 144;
    while (std::gcd(step, count) != 1) ++step;
    return i * step % count;
}

// parallel_chunks in scattered() order.
template <class Work>
void parallel_chunks_scattered(std::size_t count, std::size_t chunk, Threads& threads, const Work& work) {
    const std::size_t chunks = (count + chunk - 1) / chunk;
    threads.for_each(chunks, [&](std::size_t i) {
        const std::size_t begin = scattered(i, chunks) * chunk;
        work(begin, std::min(count, begin + chunk));
    });
}

}  // namespace wive
