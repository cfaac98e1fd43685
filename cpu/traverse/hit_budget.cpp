#include "traverse/hit_budget.h"

#include <string>

#include "core/memory.h"

namespace wive {
namespace {

// Below this, hits cost less than asking how much memory there is.
constexpr std::size_t unchecked_bytes = std::size_t{64} << 20;
// Of the memory that was available before the query: three parts for hits to one that is left. Hits take less while
// they are sorted, but for a time what was freed and what is written overlap.
constexpr std::size_t parts_for_hits = 3, parts = 4;

constexpr const char* mend = ": pass fewer rays at a time, or shorten them by tmax";

}  // namespace

void HitBudget::add(std::size_t hits) {
    const std::size_t found = found_.fetch_add(hits, std::memory_order_relaxed) + hits;
    expect_within(found);
    const std::size_t bytes = found * bytes_per_hit_;
    if (max_bytes_ > 0 || bytes < unchecked_bytes) return;
    const std::size_t available = available_memory();
    if (bytes / parts_for_hits > available / (parts - parts_for_hits))
        refuse(found, (bytes + available) / parts * parts_for_hits);
}

void HitBudget::expect_within(std::size_t hits) const {
    if (max_bytes_ > 0 && hits > max_bytes_ / bytes_per_hit_) refuse(hits, max_bytes_);
}

void HitBudget::refuse(std::size_t hits, std::size_t limit) const {
    throw OutOfMemory("found " + std::to_string(hits) + " hits so far, " + bytes_text(hits * bytes_per_hit_) +
                      ", more than the limit of " + bytes_text(limit) + mend + ", or raise max_bytes");
}

void HitBudget::no_memory() const {
    const std::size_t hits = found_.load(std::memory_order_relaxed);
    throw OutOfMemory("found " + std::to_string(hits) + " hits so far, and there is no memory for more" + mend);
}

}  // namespace wive
