// Batches of points and of the surface's closest points, as kernels read and write them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace wive {

// Points in flat arrays; the largest distance has one value for all points (stride 0) or one per point (stride 1).
template <class Real>
struct PointBatch {
    const Real* points;  // (n, 3)
    const Real* max_distance;
    std::size_t max_distance_stride;
};

template <class Real>
struct ClosestBatch {
    Real* distance;      // (n,) infinity if no triangle is near enough
    std::int32_t* prim;  // (n,) -1 if none is
    Real* uv;            // (n, 2) NaN if none is
};

}  // namespace wive
