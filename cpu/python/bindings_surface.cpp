// Points, normals and error bounds of hits, computed anew by each call.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "python/bindings.h"
#include "python/each_hit.h"
#include "surface_source.h"

namespace wive {
namespace {

// clang-format off
#include "core/number.inc"
#include "core/double3.inc"
#include "core/error_bound.inc"
// clang-format on

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

double on_triangle(TriangleCorners corner, double u, double v, int axis) {
    return (1 - u - v) * corner[0][axis] + u * corner[1][axis] + v * corner[2][axis];
}

// (v1 - v0) x (v2 - v0), along one axis.
double normal_along(TriangleCorners corner, int axis) {
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    return (corner[1][i] - corner[0][i]) * (corner[2][j] - corner[0][j]) -
           (corner[1][j] - corner[0][j]) * (corner[2][i] - corner[0][i]);
}

template <class Real>
py::array_t<double> points(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                           const Array<std::int32_t>& prim, const Array<Real>& uv) {
    expect_rows(uv, 2, prim, "uv: expected shape (n, 2), n as prim has");
    const Real* weights = uv.data();
    auto answer = make_rows<double>(prim.size());
    double* out = answer.mutable_data();
    for_each_hit(vertices, faces, prim, [=](std::size_t i, TriangleCorners corner) {
        const double u = weights[2 * i], v = weights[2 * i + 1];
        for (int axis = 0; axis < 3; ++axis) out[3 * i + axis] = corner ? on_triangle(corner, u, v, axis) : nan;
    });
    return answer;
}

template <class Real>
py::array_t<double> normals(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                            const Array<std::int32_t>& prim) {
    auto answer = make_rows<double>(prim.size());
    double* out = answer.mutable_data();
    for_each_hit(vertices, faces, prim, [=](std::size_t i, TriangleCorners corner) {
        if (!corner) {
            std::fill_n(out + 3 * i, 3, nan);
            return;
        }
        const double across[3] = {normal_along(corner, 0), normal_along(corner, 1), normal_along(corner, 2)};
        const double length = std::sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2]);
        for (int axis = 0; axis < 3; ++axis) out[3 * i + axis] = across[axis] / length;
    });
    return answer;
}

// Ray-plane intersection points in double, whatever the tree's precision. For grazing rays, whose intersection is
// ill-conditioned, the point at u and v instead.
template <class Real>
py::array_t<double> points_on_rays(const Array<double>& vertices, const Array<std::int32_t>& faces,
                                   const Array<std::int32_t>& prim, const Array<Real>& uv,
                                   const Array<std::int64_t>& ray, const Array<double>& origins,
                                   const Array<double>& directions) {
    constexpr double grazing = 1e-3;  // the sine of the angle
    expect_shape(origins, 3, "origins: expected shape (n, 3)");
    expect_shape(directions, 3, "directions: expected shape (n, 3)");
    expect_rows(uv, 2, prim, "uv: expected shape (n, 2), n as prim has");
    expect(ray.size() == prim.size(), "ray: expected as many as prim");
    expect(origins.shape(0) == directions.shape(0), "directions: expected as many as origins");
    const Real* weights = uv.data();
    const std::int64_t* rays = ray.data();
    const double *from = origins.data(), *along = directions.data();
    const auto ray_count = static_cast<std::uint64_t>(origins.shape(0));
    auto answer = make_rows<double>(prim.size());
    double* rows = answer.mutable_data();
    for_each_hit(vertices, faces, prim, [=](std::size_t i, TriangleCorners corner) {
        const std::size_t index = load_index(rays + i);
        double* out = rows + 3 * i;
        if (!corner || index >= ray_count) {
            std::fill_n(out, 3, nan);
            return;
        }
        const double *o = from + 3 * index, *d = along + 3 * index;
        double slope = 0, height = 0, area = 0, length = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const double across = normal_along(corner, axis);
            slope += across * d[axis];
            height += across * (corner[0][axis] - o[axis]);
            area += across * across;
            length += d[axis] * d[axis];
        }
        const double u = weights[2 * i], v = weights[2 * i + 1], t = height / slope;
        const bool steep = std::abs(slope) > grazing * std::sqrt(area) * std::sqrt(length);
        for (int axis = 0; axis < 3; ++axis)
            out[axis] = steep ? o[axis] + t * d[axis] : on_triangle(corner, u, v, axis);
    });
    return answer;
}

// constants: the members of ErrorBound.
template <class Real>
py::array_t<double> error_bounds(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                                 const Array<std::int32_t>& prim, const Array<Real>& t, const Array<Real>& origins,
                                 const Array<Real>& directions, const std::array<double, 3>& constants) {
    expect(t.size() == prim.size(), "t: expected as many as prim");
    expect_rows(origins, 3, prim, "origins: expected shape (n, 3), n as prim has");
    expect_rows(directions, 3, prim, "directions: expected shape (n, 3), n as prim has");
    const auto [rounding, margin, underflow] = constants;
    const ErrorBound error = {rounding, margin, underflow};
    const Real *distances = t.data(), *from = origins.data(), *along = directions.data();
    expect_memory(sizeof(double) * static_cast<std::size_t>(prim.size()));
    auto answer = new_array<double>({prim.size()});
    double* out = answer.mutable_data();
    for_each_hit(vertices, faces, prim, [=](std::size_t i, TriangleCorners corner) {
        const double origin[3] = {from[3 * i], from[3 * i + 1], from[3 * i + 2]};
        const double direction[3] = {along[3 * i], along[3 * i + 1], along[3 * i + 2]};
        out[i] = corner ? error.bound(corner, distances[i], origin, direction) : nan;
    });
    return answer;
}

}  // namespace

void bind_surface(py::module_& m) {
    m.attr("surface_source") = surface_source;
    m.attr("distance_source") = distance_source;
    for_each_precision([&]<class Real>(Real) {
        m.def("surface_points", &points<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("uv"));
        m.def("points_on_rays", &points_on_rays<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("uv"), array_arg("ray"), array_arg("origins"), array_arg("directions"));
        m.def("surface_normals", &normals<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"));
        m.def("error_bounds", &error_bounds<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("t"), array_arg("origins"), array_arg("directions"), py::arg("constants"));
    });
}

}  // namespace wive
