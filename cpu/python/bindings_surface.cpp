// Points, normals and error bounds of hits and origins of rays that leave from there, computed anew by each call.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "kernels/dispatch.h"
#include "kernels/surface_kernels.h"
#include "python/bindings.h"
#include "python/each_hit.h"
#include "surface_source.h"

namespace wive {
namespace {

// clang-format off
#include "core/number.inc"
#include "core/double3.inc"
#include "core/facet.inc"
// clang-format on

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// The kernels of that name, or if it is empty the best.
template <class Real>
const SurfaceKernels<Real>& kernels_of(const std::string& name) {
    return *find_surface_kernels<Real>(name.empty() ? best_isa() : find_isa(name));
}

template <class Call>
void run(void (*kernel)(const Call&, std::size_t, std::size_t), const Call& call) {
    for_each_chunk(call.triangles.size, 0, [&](std::size_t begin, std::size_t end) { kernel(call, begin, end); });
}

template <class Real>
py::array_t<double> points(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                           const Array<std::int32_t>& prim, const Array<Real>& uv, const std::string& kernel) {
    expect_rows(uv, 2, prim, "uv: expected shape (n, 2), n as prim has");
    auto answer = make_rows<double>(prim.size());
    const PointsCall<Real> call = {hit_triangles(vertices, faces, prim), uv.data(), answer.mutable_data()};
    run(kernels_of<Real>(kernel).points, call);
    return answer;
}

template <class Real>
py::array_t<double> normals(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                            const Array<std::int32_t>& prim, const std::string& kernel) {
    auto answer = make_rows<double>(prim.size());
    const NormalsCall<Real> call = {hit_triangles(vertices, faces, prim), answer.mutable_data()};
    run(kernels_of<Real>(kernel).normals, call);
    return answer;
}

// constants: the members of ErrorBound.
template <class Real>
py::array_t<double> error_bounds(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                                 const Array<std::int32_t>& prim, const Array<Real>& t, const Array<Real>& origins,
                                 const Array<Real>& directions, const std::array<double, 3>& constants,
                                 const std::string& kernel) {
    expect(t.size() == prim.size(), "t: expected as many as prim");
    expect_rows(origins, 3, prim, "origins: expected shape (n, 3), n as prim has");
    expect_rows(directions, 3, prim, "directions: expected shape (n, 3), n as prim has");
    expect_memory(sizeof(double) * static_cast<std::size_t>(prim.size()));
    auto answer = new_array<double>({prim.size()});
    const ErrorBoundsCall<Real> call = {hit_triangles(vertices, faces, prim),
                                        t.data(),
                                        origins.data(),
                                        directions.data(),
                                        constants,
                                        answer.mutable_data()};
    run(kernels_of<Real>(kernel).error_bounds, call);
    return answer;
}

// constants: the members of SpawnOrigin from point_error on.
template <class Real>
py::array_t<Real> spawn_origins(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                                const Array<std::int32_t>& prim, const Array<Real>& uv, const Array<Real>& directions,
                                int accuracy, const std::array<double, 8>& constants, const std::string& kernel) {
    expect_rows(uv, 2, prim, "uv: expected shape (n, 2), n as prim has");
    expect_rows(directions, 3, prim, "directions: expected shape (n, 3), n as prim has");
    auto answer = make_rows<Real>(prim.size());
    const SpawnCall<Real> call = {hit_triangles(vertices, faces, prim), uv.data(), directions.data(),
                                  static_cast<Accuracy>(accuracy),      constants, answer.mutable_data()};
    run(kernels_of<Real>(kernel).spawn, call);
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
        const Double3 origin = Double3::load(from + 3 * index), direction = Double3::load(along + 3 * index);
        const Double3 normal = Facet::normal(corner);
        const double slope = Double3::dot(normal, direction);
        const double height = Double3::dot(normal, Double3::load(corner[0]) - origin);
        const double area = Double3::dot(normal, normal), length = Double3::dot(direction, direction);
        const bool steep = std::abs(slope) > grazing * std::sqrt(area) * std::sqrt(length);
        const Double3 point =
            steep ? origin + direction * (height / slope) : Facet::point(corner, weights[2 * i], weights[2 * i + 1]);
        point.store(out);
    });
    return answer;
}

}  // namespace

void bind_surface(py::module_& m) {
    m.attr("surface_source") = surface_source;
    m.attr("distance_source") = distance_source;
    for_each_precision([&]<class Real>(Real) {
        m.def("surface_points", &points<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("uv"), py::arg("kernel") = "");
        m.def("points_on_rays", &points_on_rays<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("uv"), array_arg("ray"), array_arg("origins"), array_arg("directions"));
        m.def("surface_normals", &normals<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              py::arg("kernel") = "");
        m.def("error_bounds", &error_bounds<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("t"), array_arg("origins"), array_arg("directions"), py::arg("constants"),
              py::arg("kernel") = "");
        m.def("spawn_origins", &spawn_origins<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("uv"), array_arg("directions"), py::arg("accuracy"), py::arg("constants"),
              py::arg("kernel") = "");
    });
}

}  // namespace wive
