// The kernels of closest points, by instruction set, precision and form of the tree; and batches on several threads.
#pragma once

#include <cstddef>

#include "core/closest.h"
#include "core/layout.h"
#include "core/ray.h"
#include "kernels/parts.h"

namespace wive {

template <class Real>
using FindClosest = void (*)(const BvhView&, const PointBatch<Real>&, const ClosestBatch<Real>&, const RaySource&);

// By the tree's accuracy, watertight and exact alike, and its node form.
template <class Real>
struct ClosestKernels {
    FindClosest<Real> of_corners[node_form_count], of_edges[node_form_count];

    FindClosest<Real> find(Accuracy accuracy, NodeForm nodes) const {
        return (accuracy == Accuracy::fast ? of_edges : of_corners)[static_cast<std::size_t>(nodes)];
    }
};

// Defined for the instruction sets of this build, each in a unit of its own.
template <IsaName isa, class Real>
const ClosestKernels<Real>* closest_kernels();

// Those of an instruction set; null if this build has none.
template <class Real>
const ClosestKernels<Real>* find_closest_kernels(IsaName isa);

// The closest points for points [0, count) of the batch. threads 0: every core.
template <class Real>
void find_closest_points(FindClosest<Real> kernel, const BvhView& bvh, const PointBatch<Real>& points,
                         const ClosestBatch<Real>& out, std::size_t count, unsigned threads);

}  // namespace wive
