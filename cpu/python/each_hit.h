// Loops over hits that Python holds in arrays: the corners of each one's triangle, on every core.
#pragma once

#include <type_traits>

#include "core/memory.h"
#include "core/parallel.h"
#include "python/bindings.h"

namespace wive {

inline constexpr std::size_t hits_per_chunk = 1 << 12;

using TriangleCorners = const double (*)[3];

// An index in an array of the caller's, which another thread may write to: read once, so that what is checked is what
// is used.
template <class Index>
std::size_t load_index(const Index* from) {
    return static_cast<std::size_t>(static_cast<std::make_unsigned_t<Index>>(__atomic_load_n(from, __ATOMIC_RELAXED)));
}

// Calls row(i, corners of the triangle of hit i, in double) on so many threads (0 is every core), with the interpreter
// lock released. The corners of a miss are null.
template <class Real, class Row>
void for_each_hit(const Array<Real>& vertices, const Array<std::int32_t>& faces, const Array<std::int32_t>& prim,
                  const Row& row, unsigned requested_threads = 0) {
    expect_shape(vertices, 3, "vertices: expected shape (v, 3)");
    expect_shape(faces, 3, "faces: expected shape (f, 3)");
    const std::int32_t *prims = prim.data(), *corners = faces.data();
    const Real* points = vertices.data();
    const auto face_count = static_cast<std::size_t>(faces.shape(0)),
               point_count = static_cast<std::size_t>(vertices.shape(0));
    const auto hits = static_cast<std::size_t>(prim.size());
    const Released released;
    Threads threads(hits > hits_per_chunk ? thread_count(requested_threads) : 1);
    parallel_chunks(hits, hits_per_chunk, threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const auto face = load_index(prims + i);
            double corner[3][3];
            bool known = face < face_count;
            for (std::size_t k = 0; known && k < 3; ++k) {
                const auto vertex = load_index(corners + 3 * face + k);
                known = vertex < point_count;
                for (std::size_t axis = 0; known && axis < 3; ++axis) corner[k][axis] = points[3 * vertex + axis];
            }
            row(i, known ? corner : nullptr);
        }
    });
}

// An array of three columns.
template <class T>
py::array_t<T> make_rows(py::ssize_t count) {
    expect_memory(3 * sizeof(T) * static_cast<std::size_t>(count));
    return py::array_t<T>({count, py::ssize_t{3}});
}

// Throws unless `array` has that many columns and one row per hit.
template <class T>
void expect_rows(const Array<T>& array, py::ssize_t columns, const Array<std::int32_t>& prim, const char* message) {
    expect_shape(array, columns, message);
    expect(array.shape(0) == prim.size(), message);
}

}  // namespace wive
