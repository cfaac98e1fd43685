// Line of sight: rays along segments, and which of the triangles that they hit lie between a segment's ends.
#include <array>
#include <cmath>

#include "python/bindings.h"
#include "python/each_hit.h"

namespace wive {
namespace {

// clang-format off
#include "core/number.inc"
#include "core/double3.inc"
#include "core/separation.inc"
// clang-format on

// The ends of segments, (n,3), or (1,3) if all segments share one.
class Ends {
public:
    Ends(const Array<double>& rows, const char* message) : data_(rows.data()), stride_(rows.shape(0) == 1 ? 0 : 3) {
        expect_shape(rows, 3, message);
    }
    const double* operator[](std::size_t i) const { return data_ + stride_ * i; }

private:
    const double* data_;
    std::size_t stride_;
};

py::ssize_t segment_count(const Array<double>& a, const Array<double>& b) {
    const py::ssize_t count = a.shape(0) == 1 ? b.shape(0) : a.shape(0);
    expect(b.shape(0) == count || b.shape(0) == 1, "b: expected as many as a");
    return count;
}

// Whether a ray along the segment starts at a: at the end that is nearer to `center`, of two equally near ones at the
// one with the lesser coordinates. So a segment and its reverse are one ray.
bool starts_at_first(const double* a, const double* b, Double3 center) {
    const double from_a = (Double3::load(a) - center).abs().max(), from_b = (Double3::load(b) - center).abs().max();
    if (from_a != from_b) return from_a < from_b;
    for (int axis = 0; axis < 3; ++axis)
        if (a[axis] != b[axis]) return a[axis] < b[axis];
    return true;
}

// Origins and directions (n,3) of rays that run along segments from t = 0 to t = 1.
py::tuple segment_rays(const Array<double>& a, const Array<double>& b, const std::array<double, 3>& center,
                       unsigned threads) {
    const Ends first(a, "a: expected shape (n, 3)"), second(b, "b: expected shape (n, 3)");
    const py::ssize_t count = segment_count(a, b);
    auto origins = make_rows<double>(count), directions = make_rows<double>(count);
    double *from = origins.mutable_data(), *along = directions.mutable_data();
    const Double3 middle = Double3::load(center.data());
    for_each_chunk(static_cast<std::size_t>(count), threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const bool forward = starts_at_first(first[i], second[i], middle);
            const Double3 start = Double3::load(forward ? first[i] : second[i]);
            start.store(from + 3 * i);
            (Double3::load(forward ? second[i] : first[i]) - start).store(along + 3 * i);
        }
    });
    return py::make_tuple(std::move(origins), std::move(directions));
}

// (h,) whether triangle prim[k] lies between the ends of segment row[k]; false for a miss. constants: the members of
// Separation; errors: how far coordinates of a and b are off, relative to them.
template <class Real>
Array<bool> between(const Array<Real>& vertices, const Array<std::int32_t>& faces, const Array<std::int32_t>& prim,
                    const Array<std::int64_t>& row, const Array<double>& a, const Array<double>& b,
                    const std::array<double, 2>& constants, const std::array<double, 2>& errors, unsigned threads) {
    const Ends first(a, "a: expected shape (n, 3)"), second(b, "b: expected shape (n, 3)");
    const auto segments = static_cast<std::size_t>(segment_count(a, b));
    expect(row.size() == prim.size(), "row: expected as many as prim");
    const Separation separation = {constants[0], constants[1]};
    const std::int64_t* rows = row.data();
    expect_memory(static_cast<std::size_t>(prim.size()));
    auto answer = new_array<bool>({prim.size()});
    bool* out = answer.mutable_data();
    const auto decide = [&](std::size_t k, TriangleCorners corner) {
        const std::size_t i = load_index(rows + k);
        out[k] = corner && i < segments && separation.separates(corner, first[i], second[i], errors[0], errors[1]);
    };
    for_each_hit(vertices, faces, prim, decide, threads);
    return answer;
}

}  // namespace

void bind_segments(py::module_& m) {
    m.def("segment_rays", &segment_rays, array_arg("a"), array_arg("b"), py::arg("center"), py::arg("threads") = 0);
    for_each_precision([&]<class Real>(Real) {
        m.def("between", &between<Real>, array_arg("vertices"), array_arg("faces"), array_arg("prim"), array_arg("row"),
              array_arg("a"), array_arg("b"), py::arg("constants"), py::arg("errors"), py::arg("threads") = 0);
    });
}

}  // namespace wive
