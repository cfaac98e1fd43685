// How much memory the hits of one query may take, all its threads together.
#pragma once

#include <atomic>
#include <cstddef>

namespace wive {

class HitBudget {
public:
    // max_bytes: the limit, or 0: three quarters of the memory that is available when the query begins.
    HitBudget(std::size_t bytes_per_hit, std::size_t max_bytes)
        : bytes_per_hit_(bytes_per_hit), max_bytes_(max_bytes) {}

    // Counts hits that a thread has found. Throws OutOfMemory if all threads' are over the limit.
    void add(std::size_t hits);
    // Throws OutOfMemory if so many are over the limit that the caller gave. What a query returns is decided by this,
    // and does not depend on the threads.
    void expect_within(std::size_t hits) const;
    // Throws OutOfMemory: the system has no memory for more.
    [[noreturn]] void no_memory() const;

private:
    [[noreturn]] void refuse(std::size_t hits, std::size_t limit) const;

    const std::size_t bytes_per_hit_, max_bytes_;
    std::atomic<std::size_t> found_{0};
};

}  // namespace wive
