#include "kernels/trace.h"

#include <algorithm>

#include "core/large_array.h"
#include "kernels/share_runs.h"
#include "traverse/hit_list.h"

namespace wive {
namespace {

// Rays that a thread takes at a time: enough that taking them costs nothing, few enough to balance the threads.
constexpr std::size_t rays_per_run = 1024;
// Rays in flight if the caller leaves the choice, measured by `python -m bench inflight`.
constexpr unsigned usual_in_flight = 24;
// A smaller batch is traced ray by ray: filling and draining the flights would take most of its time.
constexpr std::size_t fewest_in_flight = 16;

}  // namespace

unsigned worker_count(std::size_t count, unsigned threads) { return worker_count(count, rays_per_run, threads); }

template <class Real>
void trace(const KernelTable<Real>& table, TraceBatch<Real> kernel, const BvhView& bvh, const RayBatch<Real>& rays,
           const HitBatch<Real>& hits, std::size_t count, unsigned threads, unsigned in_flight) {
    if (in_flight == 0) in_flight = count < fewest_in_flight ? 1 : usual_in_flight;
    in_flight = std::min<unsigned>(in_flight, max_in_flight);
    in_flight = static_cast<unsigned>(std::min<std::size_t>(in_flight, count));
    share_runs(count, rays_per_run, worker_count(count, threads), [&](std::size_t worker, const RaySource& source) {
        LargeArray<std::byte> scratch(in_flight > 1 ? in_flight * table.flight_bytes : 0);
        HitBatch<Real> own = hits;
        if (own.found) own.found += worker;
        kernel(bvh, rays, own, source, in_flight, scratch.data());  // -> trace_batch() in traverse/in_flight.h
    });
}

template void trace(const KernelTable<float>&, TraceBatch<float>, const BvhView&, const RayBatch<float>&,
                    const HitBatch<float>&, std::size_t, unsigned, unsigned);
template void trace(const KernelTable<double>&, TraceBatch<double>, const BvhView&, const RayBatch<double>&,
                    const HitBatch<double>&, std::size_t, unsigned, unsigned);

}  // namespace wive
