#include "kernels/closest_kernels.h"

#include "kernels/of_isa.h"
#include "kernels/share_runs.h"

namespace wive {
namespace {

// Points that a thread takes at a time.
constexpr std::size_t points_per_run = 256;

}  // namespace

template <class Real>
const ClosestKernels<Real>* find_closest_kernels(IsaName isa) {
    return of_isa(isa, [](auto known) { return closest_kernels<known(), Real>(); });
}

template const ClosestKernels<float>* find_closest_kernels(IsaName);
template const ClosestKernels<double>* find_closest_kernels(IsaName);

template <class Real>
void find_closest_points(FindClosest<Real> kernel, const BvhView& bvh, const PointBatch<Real>& points,
                         const ClosestBatch<Real>& out, std::size_t count, unsigned threads) {
    share_runs(count, points_per_run, worker_count(count, points_per_run, threads),
               [&](std::size_t, const RaySource& source) { kernel(bvh, points, out, source); });
}

template void find_closest_points(FindClosest<float>, const BvhView&, const PointBatch<float>&,
                                  const ClosestBatch<float>&, std::size_t, unsigned);
template void find_closest_points(FindClosest<double>, const BvhView&, const PointBatch<double>&,
                                  const ClosestBatch<double>&, std::size_t, unsigned);

}  // namespace wive
