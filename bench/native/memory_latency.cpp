// Latency of a load from memory: a pointer chase through one random cycle over an array larger than every cache.

#include <sys/mman.h>

#include <time.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace {

struct alignas(64) Line {
    const Line* next;
};

// CPU time of this thread, which excludes other work of a shared machine.
double thread_seconds() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

// Seconds per load in a chain of `loads` over `bytes` of memory, in huge pages if the system has them: the least of
// eight parts of the chain. Negative if there is not enough memory.
extern "C" double memory_latency(std::size_t bytes, std::size_t loads) {
    constexpr std::size_t huge_page = std::size_t{2} << 20;
    const std::size_t count = bytes / sizeof(Line);
    void* memory = mmap(nullptr, bytes + huge_page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) return -1;
    const std::uintptr_t aligned = (reinterpret_cast<std::uintptr_t>(memory) + huge_page - 1) / huge_page * huge_page;
    madvise(reinterpret_cast<void*>(aligned), bytes, MADV_HUGEPAGE);
    Line* lines = reinterpret_cast<Line*>(aligned);

    // Sattolo's shuffle gives one cycle through all lines.
    std::vector<std::uint32_t> successor(count);
    for (std::size_t i = 0; i < count; ++i) successor[i] = static_cast<std::uint32_t>(i);
    std::mt19937_64 random(1);
    for (std::size_t i = count - 1; i > 0; --i) {
        const std::size_t k = random() % i;
        const std::uint32_t kept = successor[i];
        successor[i] = successor[k];
        successor[k] = kept;
    }
    for (std::size_t i = 0; i < count; ++i) lines[i].next = lines + successor[i];

    constexpr std::size_t parts = 8;
    double least = std::numeric_limits<double>::infinity();
    const Line* line = lines;
    for (std::size_t part = 0; part < parts; ++part) {
        const double start = thread_seconds();
        for (std::size_t i = 0; i < loads / parts; ++i) line = line->next;
        const Line* volatile last = line;  // the chain must not be optimised away
        (void)last;
        least = std::min(least, thread_seconds() - start);
    }
    munmap(memory, bytes + huge_page);
    return least / static_cast<double>(loads / parts);
}
