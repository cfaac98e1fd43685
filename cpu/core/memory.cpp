#include "core/memory.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <limits>
#include <sstream>
#include <string_view>

#include "core/control_groups.h"
#include "core/poll.h"

#if defined(__linux__)
#include <sys/resource.h>
#endif

namespace wive {
namespace {

constexpr std::size_t unlimited = std::numeric_limits<std::size_t>::max();
// Filling this much takes a thousand times as long as asking how much there is.
constexpr std::size_t unchecked_bytes = std::size_t{64} << 20;

// The number in a file that holds one; `otherwise` if there is no such file or it says "max".
std::size_t number_in(const std::string& path, std::size_t otherwise) {
    std::ifstream file(path);
    std::uint64_t number = 0;
    return file >> number ? static_cast<std::size_t>(number) : otherwise;
}

// The number after `name` in a file of lines "name number".
std::size_t number_of(const std::string& path, std::string_view name, std::size_t otherwise) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
        std::istringstream words(line);
        std::string first;
        std::uint64_t number = 0;
        if (words >> first >> number && first == name) return static_cast<std::size_t>(number);
    }
    return otherwise;
}

// The files of a control group's memory, in one version of the interface.
struct GroupFiles {
    std::string_view limit, usage, reclaimable;
};
constexpr GroupFiles version_1 = {"memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"};
constexpr GroupFiles version_2 = {"memory.max", "memory.current", "inactive_file"};

// What one group leaves: its limit less what it uses. Cached files that were not used lately give way.
std::size_t left_in(const std::string& folder, const GroupFiles& files) {
    const std::size_t limit = number_in(folder + "/" + std::string(files.limit), unlimited);
    const std::size_t used = number_in(folder + "/" + std::string(files.usage), 0);
    const std::size_t reclaimable = number_of(folder + "/memory.stat", files.reclaimable, 0);
    if (limit == unlimited) return unlimited;
    const std::size_t kept = used - std::min(used, reclaimable);
    return limit - std::min(limit, kept);
}

std::size_t left_in_groups(const std::string& root) {
    std::size_t left = unlimited;
    for_each_group(root, "memory", [&](const std::string& folder, GroupVersion version) {
        left = std::min(left, left_in(folder, version == GroupVersion::two ? version_2 : version_1));
    });
    return left;
}

}  // namespace

std::size_t available_memory(const std::string& root) {
    std::size_t system = unlimited;
#if defined(__linux__)
    constexpr std::size_t kibibyte = 1024;
    const std::size_t kibibytes = number_of(root + "/proc/meminfo", "MemAvailable:", unlimited / kibibyte);
    system = kibibytes * kibibyte;
#endif
    return std::min(system, left_in_groups(root));
}

void expect_memory(std::size_t bytes) {
    if (bytes < unchecked_bytes) return;
    const std::size_t available = available_memory();
    if (bytes > available)
        throw OutOfMemory("not enough memory: " + bytes_text(bytes) + " needed, " + bytes_text(available) +
                          " available");
}

bool requests_can_fail() {
#if defined(__linux__)
    constexpr std::size_t strict = 2;  // proc(5), overcommit_memory
    static const bool always = number_in("/proc/sys/vm/overcommit_memory", 0) == strict;
    rlimit limit{};
    return always || (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY);
#else
    return false;
#endif
}

bool can_throw() {
    // More than throwing takes. Freed at once: so much can be had, and is not kept from others.
    constexpr std::size_t enough = 16384;
    void* volatile memory = std::malloc(enough);  // volatile: compilers leave unused requests out
    if (memory == nullptr) return false;
    std::free(memory);
    prepare_to_throw();
    return true;
}

void prepare_to_throw() {
    // volatile: compilers leave out a call whose result is not used. It allocates the thread's record of exceptions.
    [[maybe_unused]] const volatile int exceptions = std::uncaught_exceptions();
    poll_caller();  // likewise the thread's variables of this library
}

std::string bytes_text(std::size_t bytes) {
    constexpr std::string_view units[] = {"bytes", "KiB", "MiB", "GiB", "TiB"};
    std::size_t unit = 0;
    auto number = static_cast<double>(bytes);
    for (; number >= 1024 && unit + 1 < std::size(units); ++unit) number /= 1024;
    std::ostringstream text;
    text.setf(std::ios::fixed);
    text.precision(unit == 0 ? 0 : 1);
    text << number << ' ' << units[unit];
    return text.str();
}

}  // namespace wive
