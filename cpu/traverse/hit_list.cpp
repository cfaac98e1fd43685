#include "traverse/hit_list.h"

#include <algorithm>

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
    const std::size_t size = chunks_.empty() ? first_chunk : std::min(2 * chunks_.back().size(), largest_chunk);
    LargeArray<FoundHit>& chunk = chunks_.emplace_back(size);
    next_ = chunk.data();
    end_ = next_ + size;
}

template class HitList<float>;
template class HitList<double>;

}  // namespace wive
