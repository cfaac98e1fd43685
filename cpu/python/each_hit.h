// Loops over hits that Python holds in arrays: the corners of each one's triangle, on every core.
#pragma once

#include <algorithm>

#include "core/hit_triangles.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "python/bindings.h"

namespace wive {

inline constexpr std::size_t hits_per_chunk = 1 << 12;

using TriangleCorners = const double (*)[3];

// Calls work(begin, end) for chunks of `size` rows, on so many threads (0 is every core), with the interpreter lock
// released.
template <class Work>
void for_each_chunk(std::size_t size, unsigned requested_threads, const Work& work) {
    const Released released;
    Threads threads(size > hits_per_chunk ? thread_count(requested_threads) : 1);
    parallel_chunks(size, hits_per_chunk, threads, work);
}

template <class Real>
HitTriangles<Real> hit_triangles(const Array<Real>& vertices, const Array<std::int32_t>& faces,
                                 const Array<std::int32_t>& prim) {
    expect_shape(vertices, 3, "vertices: expected shape (v, 3)");
    expect_shape(faces, 3, "faces: expected shape (f, 3)");
    const auto size = [](py::ssize_t count) { return static_cast<std::size_t>(count); };
    return {vertices.data(),   faces.data(),         prim.data(),
            size(prim.size()), size(faces.shape(0)), size(vertices.shape(0))};
}

// Calls row(i, corners of the triangle of hit i, in double), in chunks. The corners of a miss are null.
template <class Real, class Row>
void for_each_hit(const Array<Real>& vertices, const Array<std::int32_t>& faces, const Array<std::int32_t>& prim,
                  const Row& row, unsigned threads = 0) {
    const HitTriangles<Real> triangles = hit_triangles(vertices, faces, prim);
    for_each_chunk(triangles.size, threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Real* from[3];
            double corner[3][3];
            const bool found = triangles.find(i, from);
            for (std::size_t k = 0; found && k < 3; ++k) std::copy_n(from[k], 3, corner[k]);
            row(i, found ? corner : nullptr);
        }
    });
}

// An array of three columns.
template <class T>
Array<T> make_rows(py::ssize_t count) {
    expect_memory(3 * sizeof(T) * static_cast<std::size_t>(count));
    return new_array<T>({count, 3});
}

// Throws unless `array` has that many columns and one row per hit.
template <class T>
void expect_rows(const Array<T>& array, py::ssize_t columns, const Array<std::int32_t>& prim, const char* message) {
    expect_shape(array, columns, message);
    expect(array.shape(0) == prim.size(), message);
}

}  // namespace wive
