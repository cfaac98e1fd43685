#include "traverse/hit_list.h"

#include <algorithm>
#include <new>

#include "core/memory.h"
#include "traverse/hit_budget.h"

namespace wive {
namespace {

// In hits. The first chunk of 6 KB (float64: 10 KB) is enough for a single ray; the largest fill huge pages.
constexpr std::size_t first_chunk = 256, largest_chunk = std::size_t{1} << 20;

}  // namespace

template <class Real>
HitList<Real>::HitList() = default;
template <class Real>
HitList<Real>::~HitList() = default;

template <class Real>
void HitList<Real>::grow() {
    const std::size_t full = chunks_.empty() ? 0 : chunks_.back().size();
    if (full > 0) budget_->add(full);
    const std::size_t size = full == 0 ? first_chunk : std::min(2 * full, largest_chunk);
    try {
        chunks_.emplace_back(size);
    } catch (const std::bad_alloc&) {
        budget_->no_memory();
    }
    next_ = chunks_.back().data();
    end_ = next_ + size;
}

template class HitList<float>;
template class HitList<double>;

}  // namespace wive
