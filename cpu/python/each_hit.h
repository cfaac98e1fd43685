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

// Calls work(begin, end) for chunks of `size` rows, on so many threads (0 is every core), with the interpreter lock
// released.
template <class Work>
void for_each_chunk(std::size_t size, unsigned requested_threads, const Work& work) {
    const Released released;
    Threads threads(size > hits_per_chunk ? thread_count(requested_threads) : 1);
    parallel_chunks(size, hits_per_chunk, threads, work);
}

// The triangles of hits: rows of `faces`, or none.
template <class Real>
class HitTriangles {
public:
    HitTriangles(const Array<Real>& vertices, const Array<std::int32_t>& faces, const Array<std::int32_t>& prim)
        : points_(vertices.data()), corners_(faces.data()), prims_(prim.data()), size_(to_size(prim.size())) {
        expect_shape(vertices, 3, "vertices: expected shape (v, 3)");
        expect_shape(faces, 3, "faces: expected shape (f, 3)");
        face_count_ = to_size(faces.shape(0));
        point_count_ = to_size(vertices.shape(0));
    }
    std::size_t size() const { return size_; }

    // Calls set(k, axis, coordinate) for the corners of the triangle of hit i; false if there is no such triangle.
    template <class Set>
    bool load(std::size_t i, const Set& set) const {
        const auto face = load_index(prims_ + i);
        if (face >= face_count_) return false;
        for (std::size_t k = 0; k < 3; ++k) {
            const auto vertex = load_index(corners_ + 3 * face + k);
            if (vertex >= point_count_) return false;
            for (std::size_t axis = 0; axis < 3; ++axis) set(k, axis, points_[3 * vertex + axis]);
        }
        return true;
    }

private:
    static std::size_t to_size(py::ssize_t size) { return static_cast<std::size_t>(size); }

    const Real* points_;
    const std::int32_t *corners_, *prims_;
    std::size_t size_, face_count_ = 0, point_count_ = 0;
};

// Calls row(i, corners of the triangle of hit i, in double), in chunks. The corners of a miss are null.
template <class Real, class Row>
void for_each_hit(const Array<Real>& vertices, const Array<std::int32_t>& faces, const Array<std::int32_t>& prim,
                  const Row& row, unsigned threads = 0) {
    const HitTriangles<Real> triangles(vertices, faces, prim);
    for_each_chunk(triangles.size(), threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            double corner[3][3];
            const bool known = triangles.load(i, [&](std::size_t k, std::size_t axis, Real x) { corner[k][axis] = x; });
            row(i, known ? corner : nullptr);
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
