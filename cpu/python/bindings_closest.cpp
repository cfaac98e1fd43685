// Closest points of the surface, as Python calls them.
#include <cmath>
#include <limits>

#include "core/memory.h"
#include "kernels/closest_kernels.h"
#include "python/bindings.h"
#include "python/each_hit.h"

namespace wive {
namespace {

// clang-format off
#include "core/number.inc"
#include "core/double3.inc"
#include "core/triangle_distance.inc"
// clang-format on

template <class Real>
py::tuple closest(const PyBvh& self, const KernelArg& kernel, const Array<Real>& points,
                  const Array<Real>& max_distance, unsigned threads) {
    self.expect_precision<Real>();
    expect_shape(points, 3, "points: expected shape (n, 3)");
    const py::ssize_t count = points.shape(0);
    expect(max_distance.size() == 1 || max_distance.size() == count,
           "max_distance: expected one value or one per point");
    const Bvh& bvh = self.bvh();
    const FindClosest<Real> find =
        find_closest_kernels<Real>(find_isa(name_of(kernel)))->find(bvh.accuracy(), bvh.node_form());
    const auto size = static_cast<std::size_t>(count);
    expect_memory(size * (3 * sizeof(Real) + sizeof(std::int32_t)));
    auto distance = new_array<Real>({count}), uv = new_array<Real>({count, 2});
    auto prim = new_array<std::int32_t>({count});
    const PointBatch<Real> batch = {points.data(), max_distance.data(), max_distance.size() == 1 ? 0u : 1u};
    const ClosestBatch<Real> out = {distance.mutable_data(), prim.mutable_data(), uv.mutable_data()};
    {
        const Released released;
        find_closest_points(find, bvh.view(), batch, out, size, threads);
    }
    return py::make_tuple(std::move(distance), std::move(prim), std::move(uv));
}

template <class Real>
Array<double> winding(const PyBvh& self, const Array<Real>& points, unsigned threads) {
    self.expect_precision<Real>();
    expect_shape(points, 3, "points: expected shape (n, 3)");
    const auto size = static_cast<std::size_t>(points.shape(0));
    expect_memory(size * sizeof(double));
    auto answer = new_array<double>({points.shape(0)});
    const Real* from = points.data();
    double* out = answer.mutable_data();
    self.bvh();  // verifies a stored tree, which needs the interpreter lock
    {
        const Released released;
        self.winding<Real>().find(from, size, out, threads);
    }
    return answer;
}

// The closest point (n,3) on triangle prim[i] to each point, and its distance; NaN and infinity if there is none.
py::tuple closest_on(const Array<double>& vertices, const Array<std::int32_t>& faces, const Array<std::int32_t>& prim,
                     const Array<double>& points, unsigned threads) {
    expect_rows(points, 3, prim, "points: expected shape (n, 3), n as prim has");
    auto closest = make_rows<double>(prim.size());
    auto distance = new_array<double>({prim.size()});
    double *to = closest.mutable_data(), *far = distance.mutable_data();
    const double* from = points.data();
    const auto measure = [=](std::size_t i, TriangleCorners corner) {
        if (!corner) {
            std::fill_n(to + 3 * i, 3, std::numeric_limits<double>::quiet_NaN());
            far[i] = std::numeric_limits<double>::infinity();
            return;
        }
        const Double3 v0 = Double3::load(corner[0]), v1 = Double3::load(corner[1]), v2 = Double3::load(corner[2]);
        TriangleDistance found;
        found.measure(v0, v1, v2, Double3::load(from + 3 * i));
        double uv[2];
        found.weights(uv);
        (v0 * (1 - uv[0] - uv[1]) + v1 * uv[0] + v2 * uv[1]).store(to + 3 * i);
        far[i] = std::sqrt(found.squared());
    };
    for_each_hit(vertices, faces, prim, measure, threads);
    return py::make_tuple(std::move(closest), std::move(distance));
}

}  // namespace

void bind_closest(py::module_& m, PyBvhClass& bvh) {
    m.def("closest_on", &closest_on, array_arg("vertices"), array_arg("faces"), array_arg("prim"), array_arg("points"),
          py::arg("threads") = 0);
    for_each_precision([&]<class Real>(Real) {
        bvh.def("closest", &closest<Real>, py::arg("kernel"), array_arg("points"), array_arg("max_distance"),
                py::arg("threads") = 0);
        bvh.def("winding", &winding<Real>, array_arg("points"), py::arg("threads") = 0);
    });
}

}  // namespace wive
