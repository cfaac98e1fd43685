#include "core/thread_count.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <limits>
#include <thread>

#include "core/control_groups.h"

#if defined(__unix__) || defined(__APPLE__)
#include <pthread.h>
#endif
#if defined(__linux__)
#include <sched.h>
#endif

namespace wive {
namespace {

std::atomic<unsigned> asked_count = 0, in_use = 0;

#if defined(__unix__) || defined(__APPLE__)
// A forked process has only the thread that forked, and no call of the others ends there.
[[maybe_unused]] const int forks = pthread_atfork(nullptr, nullptr, [] { in_use = 0; });
#endif

unsigned cores_by_affinity() {
#if defined(__linux__)
    cpu_set_t cores;
    if (sched_getaffinity(0, sizeof(cores), &cores) == 0) return static_cast<unsigned>(CPU_COUNT(&cores));
#endif
    return std::max(1u, std::thread::hardware_concurrency());
}

// Cores' worth of time that a group may use; infinity if it has no quota.
double quota_of(const std::string& folder, GroupVersion version) {
    double quota = 0, period = 0;
    bool known;
    if (version == GroupVersion::two)
        known = static_cast<bool>(std::ifstream(folder + "/cpu.max") >> quota >> period);  // not if it says "max"
    else
        known = std::ifstream(folder + "/cpu.cfs_quota_us") >> quota &&
                std::ifstream(folder + "/cpu.cfs_period_us") >> period;
    return known && quota > 0 && period > 0 ? quota / period : std::numeric_limits<double>::infinity();
}

}  // namespace

unsigned usable_cores(const std::string& root) {
    double cores = cores_by_affinity();
    for_each_group(root, "cpu", [&](const std::string& folder, GroupVersion version) {
        cores = std::min(cores, std::ceil(quota_of(folder, version)));
    });
    return static_cast<unsigned>(std::max(1.0, cores));
}

unsigned thread_count(unsigned requested) {
    if (requested > 0) return requested;
    if (const unsigned asked = asked_count.load(std::memory_order_relaxed); asked > 0) return asked;
    static const unsigned by_quota = usable_cores("");  // reading quotas takes longer than tracing many rays
    const unsigned cores = std::min(by_quota, cores_by_affinity());
    return cores - std::min(cores - 1, in_use.load(std::memory_order_relaxed));
}

void set_thread_count(unsigned count) { asked_count.store(count, std::memory_order_relaxed); }

ThreadsInUse::ThreadsInUse(unsigned count) : count_(count) { in_use.fetch_add(count_, std::memory_order_relaxed); }
ThreadsInUse::~ThreadsInUse() { in_use.fetch_sub(count_, std::memory_order_relaxed); }

}  // namespace wive
