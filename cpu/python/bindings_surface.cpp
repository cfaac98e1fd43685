// Points and normals of hits, computed when they are asked for.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "python/bindings.h"

namespace wive {
namespace {

constexpr std::size_t hits_per_chunk = 1 << 12;

// Calls row(i, corners of hit i, three values of the answer) for every hit, in double, on every core.
template <class Real, class Row>
py::array_t<double> each_hit(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                             const Array<std::int32_t>& prim, const Row& row) {
    expect_shape(vertices, 3, "vertices: expected shape (v, 3)");
    expect_shape(faces, 3, "faces: expected shape (f, 3)");
    const py::ssize_t count = prim.size();
    py::array_t<double> answer({count, py::ssize_t{3}});
    double* out = answer.mutable_data();
    const std::int32_t *prims = prim.data(), *corners = faces.data();
    const Real* points = vertices.data();
    const auto face_count = static_cast<std::size_t>(faces.shape(0)),
               point_count = static_cast<std::size_t>(vertices.shape(0));
    const auto hits = static_cast<std::size_t>(count);
    py::gil_scoped_release release;
    Threads threads(hits > hits_per_chunk ? thread_count(0) : 1);
    parallel_chunks(hits, hits_per_chunk, threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const auto face = static_cast<std::size_t>(static_cast<std::uint32_t>(prims[i]));
            double corner[3][3] = {};
            bool known = face < face_count;
            for (std::size_t k = 0; known && k < 3; ++k) {
                const auto vertex = static_cast<std::size_t>(static_cast<std::uint32_t>(corners[3 * face + k]));
                known = vertex < point_count;  // the arrays are the caller's, who may have changed them since
                for (std::size_t axis = 0; known && axis < 3; ++axis) corner[k][axis] = points[3 * vertex + axis];
            }
            row(i, known, corner, out + 3 * i);
        }
    });
    return answer;
}

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

double on_triangle(const double (&corner)[3][3], double u, double v, int axis) {
    return (1 - u - v) * corner[0][axis] + u * corner[1][axis] + v * corner[2][axis];
}

// (v1 - v0) x (v2 - v0), along one axis.
double normal_along(const double (&corner)[3][3], int axis) {
    const int i = (axis + 1) % 3, j = (axis + 2) % 3;
    return (corner[1][i] - corner[0][i]) * (corner[2][j] - corner[0][j]) -
           (corner[1][j] - corner[0][j]) * (corner[2][i] - corner[0][i]);
}

template <class Real>
py::array_t<double> points(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                           const Array<std::int32_t>& prim, const Array<Real>& uv) {
    expect_shape(uv, 2, "uv: expected shape (n, 2)");
    expect(uv.shape(0) == prim.size(), "uv: expected as many as prim");
    const Real* weights = uv.data();
    return each_hit(vertices, faces, prim, [=](std::size_t i, bool known, const double (&corner)[3][3], double* out) {
        const double u = weights[2 * i], v = weights[2 * i + 1];
        for (int axis = 0; axis < 3; ++axis) out[axis] = known ? on_triangle(corner, u, v, axis) : nan;
    });
}

template <class Real>
py::array_t<double> normals(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                            const Array<std::int32_t>& prim) {
    return each_hit(vertices, faces, prim, [](std::size_t, bool known, const double (&corner)[3][3], double* out) {
        const double across[3] = {normal_along(corner, 0), normal_along(corner, 1), normal_along(corner, 2)};
        const double length = std::sqrt(across[0] * across[0] + across[1] * across[1] + across[2] * across[2]);
        for (int axis = 0; axis < 3; ++axis) out[axis] = known ? across[axis] / length : nan;
    });
}

// Where rays meet the planes of the triangles they hit, in double whatever the tree's precision; the point at u and v
// where a ray is so flat that its plane says little.
template <class Real>
py::array_t<double> points_on_rays(const Array<double>& vertices, const Array<std::int32_t>& faces,
                                   const Array<std::int32_t>& prim, const Array<Real>& uv,
                                   const Array<std::int64_t>& ray, const Array<double>& origins,
                                   const Array<double>& directions) {
    constexpr double grazing = 1e-3;  // the sine of the angle
    expect_shape(uv, 2, "uv: expected shape (n, 2)");
    expect_shape(origins, 3, "origins: expected shape (n, 3)");
    expect_shape(directions, 3, "directions: expected shape (n, 3)");
    expect(uv.shape(0) == prim.size() && ray.size() == prim.size(), "uv, ray: expected as many as prim");
    expect(origins.shape(0) == directions.shape(0), "directions: expected as many as origins");
    const Real* weights = uv.data();
    const std::int64_t* rays = ray.data();
    const double *from = origins.data(), *along = directions.data();
    const auto ray_count = static_cast<std::uint64_t>(origins.shape(0));
    return each_hit(vertices, faces, prim, [=](std::size_t i, bool known, const double (&corner)[3][3], double* out) {
        const auto index = static_cast<std::uint64_t>(rays[i]);
        if (!known || index >= ray_count) {
            std::fill(out, out + 3, nan);
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
}

}  // namespace

void bind_surface(py::module_& m) {
    for_each_precision([&]<class Real>(Real) {
        m.def("surface_points", &points<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("uv"));
        m.def("points_on_rays", &points_on_rays<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"),
              array_arg("uv"), array_arg("ray"), array_arg("origins"), array_arg("directions"));
        m.def("surface_normals", &normals<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"));
    });
}

}  // namespace wive
