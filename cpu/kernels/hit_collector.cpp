#include "kernels/hit_collector.h"

#include <algorithm>
#include <numeric>
#include <optional>

#include "core/parallel.h"
#include "core/progress.h"

namespace wive {
namespace {

// Rays per piece of work when hits are sorted.
constexpr std::size_t rays_per_sort = 4096;

template <class Real>
struct Hit {
    Real t;
    std::int32_t prim;
    Real u, v;
};

template <class Real>
bool comes_before(const Hit<Real>& a, const Hit<Real>& b) {
    return a.t != b.t ? a.t < b.t : a.prim < b.prim;
}

// Sorts rows [begin, end) through `scratch`, where the values of a hit are adjacent.
template <class Real>
void sort_rows(const SortedHits<Real>& hits, std::size_t begin, std::size_t end, std::vector<Hit<Real>>& scratch) {
    scratch.clear();
    for (std::size_t i = begin; i < end; ++i)
        scratch.push_back({hits.t[i], hits.prim[i], hits.uv[2 * i], hits.uv[2 * i + 1]});
    std::sort(scratch.begin(), scratch.end(), comes_before<Real>);
    for (std::size_t i = begin; i < end; ++i) {
        const Hit<Real>& hit = scratch[i - begin];
        hits.t[i] = hit.t;
        hits.prim[i] = hit.prim;
        hits.uv[2 * i] = hit.u;
        hits.uv[2 * i + 1] = hit.v;
    }
}

}  // namespace

template <class Real>
HitCollector<Real>::HitCollector(const KernelTable<Real>& table, TraceBatch<Real> kernel, const BvhView& bvh,
                                 const RayBatch<Real>& rays, std::size_t count, bool crossings, std::int32_t* stats,
                                 unsigned threads, unsigned in_flight, std::size_t max_bytes)
    : threads_(thread_count(threads)),
      budget_(sizeof(FoundHit<Real>), max_bytes),
      counts_(count),
      lists_(worker_count(count, threads)) {
    for (HitList<Real>& list : lists_) list.take_from(budget_);
    HitBatch<Real> hits;
    hits.count = counts_.data();
    hits.found = lists_.data();
    hits.crossings = crossings;
    hits.stats = stats;
    trace(table, kernel, bvh, rays, hits, count, threads, in_flight);
    budget_.expect_within(std::accumulate(counts_.data(), counts_.data() + count, std::size_t{0}));
}

template <class Real>
void HitCollector<Real>::write_offsets(std::int64_t* offsets) const {
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
        offsets[i] = sum;
        sum += counts_[i];
    }
    offsets[counts_.size()] = sum;
}

template <class Real>
void HitCollector<Real>::sort_into(const SortedHits<Real>& hits) {
    Threads threads(threads_);
    std::optional<ProgressPart> part(std::in_place, 0.0, 0.5);
    // One worker traces a ray, so the ray's hits are in one list and its count has one writer.
    parallel_for(lists_.size(), threads, [&](std::size_t i) {
        lists_[i].drain([&](const FoundHit<Real>& hit) {
            const std::size_t row = static_cast<std::size_t>(hits.offsets[hit.ray] + --counts_[hit.ray]);
            hits.t[row] = hit.t;
            hits.prim[row] = hit.prim;
            hits.uv[2 * row] = hit.u;
            hits.uv[2 * row + 1] = hit.v;
        });
    });
    part.emplace(0.5, 1);
    parallel_chunks(counts_.size(), rays_per_sort, threads, [&](std::size_t begin, std::size_t end) {
        std::vector<Hit<Real>> scratch;
        for (std::size_t i = begin; i < end; ++i) {
            const auto first = static_cast<std::size_t>(hits.offsets[i]),
                       last = static_cast<std::size_t>(hits.offsets[i + 1]);
            if (last - first > 1) sort_rows(hits, first, last, scratch);
        }
    });
}

template class HitCollector<float>;
template class HitCollector<double>;

}  // namespace wive
