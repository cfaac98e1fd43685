// Which of the triangles at an edge or a vertex a ray crosses: the half-open rule of rasterisers.
#pragma once

namespace wive::WIVE_ISA {

// The side on which the ray passes all three edges of a triangle, 1 or -1; 0 if it misses the triangle or sees it
// edge-on. x and y: the corners in the space in which the ray is the z axis; edge[k]: the edge function opposite to
// corner k, with its exact sign.
//
// Corners are rounded alike for all triangles that share them, so that in this space a mesh is one flat picture. With
// `crossings`, the ray is moved in it by (h, h^2), h infinitely small and positive, where no edge and no vertex lies:
// an edge function P x Q of zero becomes h^2 (Q - P)_x - h (Q - P)_y, with opposite signs for the two triangles at an
// edge. A closed surface is then crossed as often as it is beside the edge or vertex (docs/accuracy.md).
template <class Real>
[[gnu::always_inline]] inline int side_passed(const Real (&x)[3], const Real (&y)[3], const Real (&edge)[3],
                                              bool crossings) {
    bool negative = false, positive = false;
    for (int k = 0; k < 3; ++k) {
        const int p = (k + 2) % 3, q = (k + 1) % 3;
        Real side = edge[k];
        if (crossings && side == 0) side = y[p] != y[q] ? y[p] - y[q] : x[q] - x[p];
        negative |= side < 0;
        positive |= side > 0;
    }
    return int{positive} - int{negative};
}

}  // namespace wive::WIVE_ISA
