// One instruction set's kernels of points, normals, error bounds and spawned origins. CMakeLists.txt compiles this file
// once per instruction set, with that instruction set's flags and WIVE_ISA (the instruction set and namespace).
#include <algorithm>
#include <limits>
#include <type_traits>

#include "core/lanes.h"
#include "kernels/surface_kernels.h"

namespace wive {
namespace WIVE_ISA {
namespace {

constexpr std::size_t width = IsaName::WIVE_ISA == IsaName::avx512 ? 8 : IsaName::WIVE_ISA == IsaName::avx2 ? 4 : 2;
using Number = Lanes<double, width>;
using Word = Lanes<long long, width>;
using Numbers = LaneNumbers<width>;

// clang-format off
#include "core/double3.inc"
#include "core/facet.inc"
#include "core/error_bound.inc"
#include "core/spawn.inc"
#include "core/spawn_store.inc"
// clang-format on

static_assert(SpawnOrigin::fast == static_cast<int>(Accuracy::fast) &&
              SpawnOrigin::watertight == static_cast<int>(Accuracy::watertight) &&
              SpawnOrigin::exact == static_cast<int>(Accuracy::exact));

// As many hits as there are lanes; at the end of a block, one of them several times.
struct Group {
    std::size_t hit[width];
    Number corners[3][3];

    // A column of a flat array with a row per hit.
    template <class Real>
    [[gnu::always_inline]] inline Number load(const Real* rows, std::size_t columns, std::size_t column) const {
        const Real* from[width];
        for (std::size_t lane = 0; lane < width; ++lane) from[lane] = rows + columns * hit[lane];
        return Number::gather(from, column);
    }
};

// Writes what compute(group, row) puts into a row of `columns` Numbers.
template <std::size_t columns, class Real, class Out, class Compute>
[[gnu::always_inline]] inline void for_each_group(HitTriangles<Real> triangles, std::size_t begin, std::size_t end,
                                                  Out* rows, const Compute& compute) {
    constexpr std::size_t block = 64;
    for (; begin < end; begin += block) {
        const std::size_t stop = std::min(end, begin + block);
        std::fill(rows + columns * begin, rows + columns * stop, std::numeric_limits<Out>::quiet_NaN());
        typename HitTriangles<Real>::template Found<block, width> found;
        triangles.find(begin, stop, found);
        for (std::size_t first = 0; first < found.count; first += width) {
            Group group;
            const Real* corner[3][width];
            Out* out[width];
            for (std::size_t lane = 0; lane < width; ++lane) {
                group.hit[lane] = found.hit[first + lane];
                out[lane] = rows + columns * group.hit[lane];
                for (std::size_t k = 0; k < 3; ++k) corner[k][lane] = found.corner[k][first + lane];
            }
            for (std::size_t k = 0; k < 3; ++k)
                for (std::size_t axis = 0; axis < 3; ++axis) group.corners[k][axis] = Number::gather(corner[k], axis);
            Number row[columns];
            compute(group, row);
            for (std::size_t column = 0; column < columns; ++column) row[column].scatter(out, column);
        }
    }
}

template <class Real>
[[gnu::flatten]] void points(const PointsCall<Real>& call, std::size_t begin, std::size_t end) {
    for_each_group<3>(call.triangles, begin, end, call.points, [&](const Group& hits, Number* row) {
        Facet::point(hits.corners, hits.load(call.uv, 2, 0), hits.load(call.uv, 2, 1)).store(row);
    });
}

template <class Real>
[[gnu::flatten]] void normals(const NormalsCall<Real>& call, std::size_t begin, std::size_t end) {
    for_each_group<3>(call.triangles, begin, end, call.normals, [](const Group& hits, Number* row) {
        const Double3 normal = Facet::normal(hits.corners);
        (normal / Numbers::root(Double3::dot(normal, normal))).store(row);
    });
}

template <class Real>
[[gnu::flatten]] void error_bounds(const ErrorBoundsCall<Real>& call, std::size_t begin, std::size_t end) {
    const auto [rounding, margin, underflow] = call.constants;
    const ErrorBound error = {rounding, margin, underflow};
    for_each_group<1>(call.triangles, begin, end, call.bounds, [&](const Group& hits, Number* row) {
        Number origin[3], direction[3];
        for (std::size_t axis = 0; axis < 3; ++axis) {
            origin[axis] = hits.load(call.origins, 3, axis);
            direction[axis] = hits.load(call.directions, 3, axis);
        }
        row[0] = error.bound(hits.corners, hits.load(call.t, 1, 0), origin, direction);
    });
}

template <class Real>
[[gnu::flatten]] void spawn(const SpawnCall<Real>& call, std::size_t begin, std::size_t end) {
    const auto [point, normal, corner, weights, fast, step, least, margin] = call.constants;
    const SpawnOrigin spawn = {static_cast<int>(call.accuracy),
                               std::is_same_v<Real, float>,
                               point,
                               normal,
                               corner,
                               weights,
                               fast,
                               step,
                               least,
                               margin};
    for_each_group<3>(call.triangles, begin, end, call.origins, [&](const Group& hits, Number* row) {
        Number direction[3];
        for (std::size_t axis = 0; axis < 3; ++axis) direction[axis] = hits.load(call.directions, 3, axis);
        SpawnStore::write(spawn, hits.corners, hits.load(call.uv, 2, 0), hits.load(call.uv, 2, 1), direction, row);
    });
}

template <class Real>
constexpr SurfaceKernels<Real> kernels = {points<Real>, normals<Real>, error_bounds<Real>, spawn<Real>};

}  // namespace
}  // namespace WIVE_ISA

template <>
const SurfaceKernels<float>* surface_kernels<IsaName::WIVE_ISA, float>() {
    return &WIVE_ISA::kernels<float>;
}
template <>
const SurfaceKernels<double>* surface_kernels<IsaName::WIVE_ISA, double>() {
    return &WIVE_ISA::kernels<double>;
}

}  // namespace wive
