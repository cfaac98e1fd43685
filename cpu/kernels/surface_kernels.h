// What hits are asked for after the trace, by instruction set and precision.
#pragma once

#include <array>
#include <cstddef>

#include "core/hit_triangles.h"
#include "kernels/parts.h"

namespace wive {

template <class Real>
struct PointsCall {
    HitTriangles<Real> triangles;
    const Real* uv;
    double* points;
};

template <class Real>
struct NormalsCall {
    HitTriangles<Real> triangles;
    double* normals;
};

template <class Real>
struct ErrorBoundsCall {
    HitTriangles<Real> triangles;
    const Real *t, *origins, *directions;
    std::array<double, 3> constants;  // the members of ErrorBound
    double* bounds;
};

template <class Real>
struct SpawnCall {
    HitTriangles<Real> triangles;
    const Real *uv, *directions;
    Accuracy accuracy;
    std::array<double, 8> constants;  // the members of SpawnOrigin from point_error on
    Real* origins;
};

// For hits [begin, end). Rows of those without a triangle are NaN.
template <class Real>
struct SurfaceKernels {
    template <class Call>
    using Kernel = void (*)(const Call&, std::size_t begin, std::size_t end);

    Kernel<PointsCall<Real>> points;
    Kernel<NormalsCall<Real>> normals;
    Kernel<ErrorBoundsCall<Real>> error_bounds;
    Kernel<SpawnCall<Real>> spawn;
};

// Defined for the instruction sets of this build, each in a unit of its own.
template <IsaName isa, class Real>
const SurfaceKernels<Real>* surface_kernels();

// Those of an instruction set; null if this build has none.
template <class Real>
const SurfaceKernels<Real>* find_surface_kernels(IsaName isa);

}  // namespace wive
