// The caller's triangles, their checks, and the boxes that the builder makes of them.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>

#include "core/box.h"
#include "core/large_array.h"
#include "core/layout.h"
#include "core/parallel.h"

namespace wive {

// The arrays are the caller's, and another thread may write to them while a tree is built or refitted. So an index is
// read once and then checked, on every use; coordinates are read once, and a triangle that has left the range that
// check_mesh accepts is treated as one without an area.
template <class Real>
struct Mesh {
    const Real* vertices;  // (vertex_count, 3)
    std::size_t vertex_count;
    const std::int32_t* faces;  // (face_count, 3)
    std::size_t face_count;

    // A face's vertex, within the array whatever the face holds now. check_mesh has seen that there is one.
    std::size_t vertex(std::size_t face, int k) const {
        assert(face < face_count && k >= 0 && k < 3);
        const auto index = static_cast<std::size_t>(static_cast<std::uint32_t>(
            __atomic_load_n(faces + 3 * face + static_cast<std::size_t>(k), __ATOMIC_RELAXED)));
        return index < vertex_count ? index : 0;
    }
    const Real* corner(std::size_t face, int k) const { return vertices + 3 * vertex(face, k); }

    // Fetch a face, and its corners.
    void prefetch_face(std::size_t face) const { __builtin_prefetch(faces + 3 * face); }
    void prefetch_corners(std::size_t face) const {
        for (int k = 0; k < 3; ++k) __builtin_prefetch(corner(face, k));
    }

    // Copies a face's corners. False if a coordinate is out of range, or NaN.
    bool load_corners(std::size_t face, Real (&corners)[3][3]) const {
        bool in_range = true;
        for (int k = 0; k < 3; ++k) {
            const Real* from = corner(face, k);
            for (int axis = 0; axis < 3; ++axis) {
                Real x;
                __atomic_load(from + axis, &x, __ATOMIC_RELAXED);
                corners[k][axis] = x;
                in_range &= std::abs(x) <= max_coordinate<Real>;
            }
        }
        return in_range;
    }
};

inline Float4v magnitude(Float4v x) { return maximum(x, Float4v{} - x); }

// A corner, with zero in lane 3. Reads four floats, except for the last vertex, behind which there may be no memory.
inline Float4v load_corner(const Mesh<float>& mesh, std::size_t face, int k) {
    const std::size_t vertex = mesh.vertex(face, k);
    const float* v = mesh.vertices + 3 * vertex;
    if (vertex + 1 == mesh.vertex_count) return Float4v{v[0], v[1], v[2], 0};
    Int4v bits;
    std::memcpy(&bits, v, sizeof bits);
    const Int4v xyz = {-1, -1, -1, 0};
    return std::bit_cast<Float4v>(bits & xyz);
}

// Whether all coordinates are of at most max_coordinate, and none is NaN.
inline bool are_in_range(Float4v a, Float4v b, Float4v c) {
    const Float4v most = Float4v{} + max_coordinate<float>;
    const Int4v in_range = (magnitude(a) <= most) & (magnitude(b) <= most) & (magnitude(c) <= most);
    return (in_range[0] & in_range[1] & in_range[2]) != 0;
}

// A mesh of its own, which no other thread changes.
class MeshCopy {
public:
    MeshCopy(const Mesh<float>& mesh, Threads& threads);
    Mesh<float> mesh() const { return {vertices_.data(), vertices_.size() / 3, faces_.data(), faces_.size() / 3}; }

private:
    LargeArray<float> vertices_;
    LargeArray<std::int32_t> faces_;
};

// A triangle's box, prim and projected area in 32 bytes. Lane 3 of lo holds the prim, lane 3 of hi the projected area.
struct PrimRef {
    Float4v lo, hi;

    std::uint32_t prim() const { return std::bit_cast<std::uint32_t>(static_cast<float>(lo[3])); }
    // Twice the sum of the triangle's projections onto the three planes between axes.
    float projected_area() const { return hi[3]; }
    Box box() const { return {lo, hi}; }
    // Twice the box's centre. The prim's bits are cleared first: as a float they would be a denormal, which is slow.
    Float4v centroid() const {
        const Int4v xyz = {-1, -1, -1, 0};
        return std::bit_cast<Float4v>(std::bit_cast<Int4v>(lo) & xyz) + hi;
    }
};

// Throws std::invalid_argument that names the first vertex that is not finite or beyond max_coordinate, if a face uses
// it, or the first face with an index outside the vertices.
template <class Real>
void check_mesh(const Mesh<Real>& mesh, Threads& threads);

// The error for more triangles than a tree can address.
std::invalid_argument too_many_triangles(std::size_t count);

using Point = std::array<float, 3>;

// Sets `box` to a triangle's box, with the projected area in lane 3 of hi. Returns false if the triangle has no area,
// decided exactly, or is out of range. float32: the box is in the mesh's coordinates, and only planes are relative to
// the tree's centre. float64: the box itself is relative to the centre.
bool box_triangle(const Mesh<float>& mesh, const Point& center, std::size_t face, Box& box);
bool box_triangle(const Mesh<double>& mesh, const Point& center, std::size_t face, Box& box);

// The lowest and the highest corner of a box; infinity and -infinity if it is empty.
using Bounds = std::array<std::array<double, 3>, 2>;

// Grows bounds to hold the box between two corners.
template <class Corner>
void grow(Bounds& bounds, const Corner& low, const Corner& high) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        bounds[0][axis] = std::min<double>(bounds[0][axis], low[axis]);
        bounds[1][axis] = std::max<double>(bounds[1][axis], high[axis]);
    }
}

// The bounds of the triangles with an area.
template <class Real>
Bounds find_bounds(const Mesh<Real>& mesh, Threads& threads);

struct PrimRefs {
    LargeArray<PrimRef> refs;
    std::uint32_t count = 0;
    Box box, centroids;  // around all references' boxes, and around their centroids
};

// One reference per triangle with an area. The others can't be hit.
template <class Real>
PrimRefs make_prim_refs(const Mesh<Real>& mesh, const Point& center, Threads& threads);

}  // namespace wive
