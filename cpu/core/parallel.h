// Work spread over threads that live for one call: nothing is left running, so a process may fork at any time.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <mutex>
#include <numeric>
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

// Gives other threads the core until ready() or a moment has passed. To wake a sleeping thread takes the system as long
// as many a piece of work, on virtual cores longer; most waiting here is shorter than that.
template <class Ready>
void wait_a_moment(const Ready& ready) {
    using Clock = std::chrono::steady_clock;
    for (const auto end = Clock::now() + std::chrono::microseconds(200); !ready() && Clock::now() < end;)
        std::this_thread::yield();
}

// The calling thread and, once there is work for them, up to count - 1 helpers, which wait between one piece of work
// and the next, soon asleep, and end with this object. A helper that the system has not woken yet is not waited for, so
// on a busy machine the caller goes on alone.
class Threads {
public:
    explicit Threads(unsigned count) : count_(count) {}
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

    // Calls work(i) once for every i in [0, count). The first exception of any of them is thrown again here, once all
    // have stopped.
    template <class Work>
    void for_each(std::size_t count, const Work& work) {
        Job job = {count, [](const void* w, std::size_t i) { (*static_cast<const Work*>(w))(i); }, &work};
        const std::size_t wanted = std::min<std::size_t>(count_, count);
        if (wanted > 1) offer(job, wanted - 1);
        job.run();
        if (wanted > 1) withdraw();
        if (job.failure) std::rethrow_exception(job.failure);
    }

private:
    struct Job {
        std::size_t count;
        void (*call)(const void* work, std::size_t i);
        const void* work;
        std::atomic<std::size_t> next{0};
        std::atomic<bool> failed{false};
        std::exception_ptr failure{};

        void run() {
            try {
                for (std::size_t i; (i = next.fetch_add(1, std::memory_order_relaxed)) < count;) call(work, i);
            } catch (...) {
                if (!failed.exchange(true)) failure = std::current_exception();
                next.store(count, std::memory_order_relaxed);
            }
        }
    };

    void offer(Job& job, std::size_t helpers) {
        try {
            while (helpers_.size() < helpers) helpers_.emplace_back([this] { help(); });
        } catch (...) {
            // The machine has no more threads to give: the ones we have do the work.
        }
        {
            const std::lock_guard lock(mutex_);
            job_ = &job;
            ++job_number_;
        }
        wake_.notify_all();
    }

    void withdraw() {
        {
            const std::lock_guard lock(mutex_);
            job_ = nullptr;
        }
        wait_a_moment([this] { return working_ == 0; });
        std::unique_lock lock(mutex_);
        idle_.wait(lock, [this] { return working_ == 0; });
    }

    void help() {
        for (std::size_t last = 0;;) {
            wait_a_moment([&] { return ending_ || job_number_ != last; });
            std::unique_lock lock(mutex_);
            if (!job_ && !ending_ && job_number_ != last) {  // missed: the next may come soon, too
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
    std::vector<std::thread> helpers_;
    std::mutex mutex_;
    std::condition_variable wake_, idle_;
    // Written under the mutex; those that are atomic are watched without it.
    Job* job_ = nullptr;                       // null: nothing to do
    std::atomic<std::size_t> job_number_ = 0;  // so that a helper takes each job once
    std::atomic<unsigned> working_ = 0;
    std::atomic<bool> ending_ = false;
};

template <class Work>
void parallel_for(std::size_t count, Threads& threads, const Work& work) {
    threads.for_each(count, work);
}

// The same on threads of its own.
template <class Work>
void parallel_for(std::size_t count, unsigned threads, const Work& work) {
    Threads(threads).for_each(count, work);
}

// The same in chunks of a fixed size: work(begin, end). Chunks do not depend on the number of threads.
template <class Work>
void parallel_chunks(std::size_t count, std::size_t chunk, Threads& threads, const Work& work) {
    threads.for_each((count + chunk - 1) / chunk,
                     [&](std::size_t i) { work(i * chunk, std::min(count, (i + 1) * chunk)); });
}

// The i-th of the numbers below count in an order whose neighbours lie far apart, by steps of the golden ratio. For
// work that fills fresh memory: threads side by side in it would each clear the same huge page.
inline std::size_t far_apart(std::size_t i, std::size_t count) {
    std::size_t step = count * 89 / 144;
    while (std::gcd(step, count) != 1) ++step;
    return i * step % count;
}

// parallel_chunks in that order.
template <class Work>
void parallel_chunks_apart(std::size_t count, std::size_t chunk, Threads& threads, const Work& work) {
    const std::size_t chunks = (count + chunk - 1) / chunk;
    threads.for_each(chunks, [&](std::size_t i) {
        const std::size_t begin = far_apart(i, chunks) * chunk;
        work(begin, std::min(count, begin + chunk));
    });
}

}  // namespace wive
