// The caller's triangles: checked once, then boxed for the builder.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "core/box.h"
#include "core/large_array.h"
#include "core/parallel.h"

namespace wive {

template <class Real>
struct Mesh {
    const Real* vertices;  // (vertex_count, 3)
    std::size_t vertex_count;
    const std::int32_t* faces;  // (face_count, 3)
    std::size_t face_count;

    const Real* corner(std::size_t face, int k) const {
        return vertices + 3 * static_cast<std::size_t>(faces[3 * face + static_cast<std::size_t>(k)]);
    }
};

// A triangle's box, number and size, 32 bytes: the number rides in the low corner's fourth lane, the projected area in
// the high one's.
struct PrimRef {
    Float4v lo, hi;

    std::uint32_t prim() const { return std::bit_cast<std::uint32_t>(static_cast<float>(lo[3])); }
    // Twice the sum of the triangle's projections onto the three planes between axes.
    float projected_area() const { return hi[3]; }
    Box box() const { return {lo, hi}; }
    // Twice the box's centre. The number's bits are cleared first: as a float they would be a slow denormal.
    Float4v centroid() const {
        const Int4v xyz = {-1, -1, -1, 0};
        return std::bit_cast<Float4v>(std::bit_cast<Int4v>(lo) & xyz) + hi;
    }
};

// Throws std::invalid_argument naming the first vertex that is not a usable number, or the first face that
// points outside the vertices.
template <class Real>
void check_mesh(const Mesh<Real>& mesh, Threads& threads);

using Point = std::array<float, 3>;

// The box of a triangle, its projected area in the high corner's fourth lane; false where it has no area, decided
// exactly. In float32, boxes are in the mesh's coordinates whatever the tree's centre, and nodes store them relative to
// it later; in float64 they are relative to it from here on.
bool box_triangle(const Mesh<float>& mesh, const Point& center, std::size_t face, Box& box);
bool box_triangle(const Mesh<double>& mesh, const Point& center, std::size_t face, Box& box);

// The lowest and the highest corner; infinity and minus infinity without any triangle.
using Bounds = std::array<std::array<double, 3>, 2>;

// Of the triangles with an area.
Bounds find_bounds(const Mesh<double>& mesh, Threads& threads);

struct PrimRefs {
    LargeArray<PrimRef> refs;
    std::uint32_t count = 0;
    Box box, centroids;  // round all of them
};

// One reference for each triangle with an area; zero-area triangles can't be hit and are left out.
template <class Real>
PrimRefs make_prim_refs(const Mesh<Real>& mesh, const Point& center, Threads& threads);

}  // namespace wive
