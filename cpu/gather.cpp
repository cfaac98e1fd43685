#include "gather.h"

#include <algorithm>

#include "parallel.h"

namespace wive {
namespace {

// Rays to a thread at a time when their hits are sorted.
constexpr std::size_t rays_per_sort = 4096;

struct Hit {
    float t;
    std::int32_t prim;
    float u, v;
};

bool comes_before(const Hit& a, const Hit& b) { return a.t != b.t ? a.t < b.t : a.prim < b.prim; }

// Sorts rows [begin, end), by way of `together`, in which a hit stands in one piece.
void sort_rows(const SortedHits& hits, std::size_t begin, std::size_t end, std::vector<Hit>& together) {
    together.clear();
    for (std::size_t i = begin; i < end; ++i) together.push_back({hits.t[i], hits.prim[i], hits.uv[2 * i], hits.uv[2 * i + 1]});
    std::sort(together.begin(), together.end(), comes_before);
    for (std::size_t i = begin; i < end; ++i) {
        const Hit& hit = together[i - begin];
        hits.t[i] = hit.t;
        hits.prim[i] = hit.prim;
        hits.uv[2 * i] = hit.u;
        hits.uv[2 * i + 1] = hit.v;
    }
}

}  // namespace

Gathering::Gathering(const KernelTable& table, TraceBatch kernel, const BvhView& bvh, const RayBatch& rays,
                     std::size_t count, std::int32_t* stats, unsigned threads, unsigned in_flight)
    : threads_(thread_count(threads)), counts_(count), lists_(worker_count(count, threads)) {
    HitBatch hits;
    hits.count = counts_.data();
    hits.found = lists_.data();
    hits.stats = stats;
    trace(table, kernel, bvh, rays, hits, count, threads, in_flight);
}

void Gathering::write_offsets(std::int64_t* offsets) const {
    std::int64_t sum = 0;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
        offsets[i] = sum;
        sum += counts_[i];
    }
    offsets[counts_.size()] = sum;
}

void Gathering::sort_into(const SortedHits& hits) {
    Threads threads(threads_);
    // A ray is traced by one worker, so its hits are in one list and its count has one writer.
    parallel_for(lists_.size(), threads, [&](std::size_t i) {
        lists_[i].drain([&](const FoundHit& hit) {
            const std::size_t row = static_cast<std::size_t>(hits.offsets[hit.ray] + --counts_[hit.ray]);
            hits.t[row] = hit.t;
            hits.prim[row] = hit.prim;
            hits.uv[2 * row] = hit.u;
            hits.uv[2 * row + 1] = hit.v;
        });
    });
    parallel_chunks(counts_.size(), rays_per_sort, threads, [&](std::size_t begin, std::size_t end) {
        std::vector<Hit> together;
        for (std::size_t i = begin; i < end; ++i) {
            const auto first = static_cast<std::size_t>(hits.offsets[i]), last = static_cast<std::size_t>(hits.offsets[i + 1]);
            if (last - first > 1) sort_rows(hits, first, last, together);
        }
    });
}

}  // namespace wive
