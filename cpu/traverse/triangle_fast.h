// Moeller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection", on four triangles, in the precision of
// the scene. Triangles that share an edge may disagree about a ray through it.
#pragma once

#include "core/layout.h"
#include "traverse/frame.h"
#include "traverse/query.h"

namespace wive::WIVE_ISA {

template <class I>
class FastTriangles {
    using Real = typename I::Real;
    using Real4 = typename I::Real4;

public:
    using Frame = RayFrame<I>;
    static constexpr bool hits_are_in_boxes = false;  // t may lie anywhere if a triangle is seen edge-on

    [[gnu::always_inline]] explicit FastTriangles(const RayFrame<I>& ray) {
        for (int axis = 0; axis < 3; ++axis) {
            origin_[axis] = Real4::all(ray.origin[axis]);
            direction_[axis] = Real4::all(ray.direction[axis]);
        }
    }

    // The lanes of a block that are hit, and what solve() needs for t, u and v.
    struct Found {
        unsigned hit_mask;
        Real4 u, v, det, q[3];
    };

    template <class Corners>
    [[gnu::always_inline]] Found find(const Corners& corners) const {
        Found found;
        Real4 e1[3], e2[3], p[3], s[3];
        for (unsigned axis = 0; axis < 3; ++axis) {
            const Real4 v0 = corners.vertex(0, axis);
            e1[axis] = corners.edge(1, axis, v0);
            e2[axis] = corners.edge(2, axis, v0);
            s[axis] = origin_[axis] - v0;
        }
        cross(direction_, e2, p);
        cross(s, e1, found.q);
        found.det = dot(e1, p);
        const Real4 size = abs(found.det), zero = Real4::all(0);
        found.u = flip_sign(dot(s, p), found.det);
        found.v = flip_sign(dot(direction_, found.q), found.det);
        // A determinant of zero fails (the ray is in the triangle's plane), and so does NaN (an unused lane): if u is
        // NaN and v is not, min gives v, but the sum is NaN.
        found.hit_mask = corners.used(all_in_order(zero, min(found.u, found.v), found.u + found.v, size, zero, size));
        return found;
    }

    // Offers the hits to the query; true once the query is done.
    template <class Corners, OfferedQuery<Real> Query>
    [[gnu::always_inline]] bool solve(const Corners& corners, const Found& found, Query& query) const {
        alignas(4 * sizeof(Real)) Real ts[4], us[4], vs[4];
        const Real4 size = abs(found.det);
        Real4 e2[3], q[3];
        for (unsigned axis = 0; axis < 3; ++axis) {
            e2[axis] = corners.edge(2, axis, corners.vertex(0, axis));
            q[axis] = found.q[axis] / size;  // before the dot product, in which three lengths may overflow
        }
        flip_sign(dot(e2, q), found.det).store(ts);
        (found.u / size).store(us);
        (found.v / size).store(vs);
        return offer_lanes<I>(corners.block, found.hit_mask, ts, us, vs, query);
    }

private:
    [[gnu::always_inline]] static void cross(const Real4* a, const Real4* b, Real4* c) {
        for (int i = 0; i < 3; ++i) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            c[i] = a[j] * b[k] - a[k] * b[j];
        }
    }
    [[gnu::always_inline]] static Real4 dot(const Real4* a, const Real4* b) {
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    }

    Real4 origin_[3], direction_[3];
};

}  // namespace wive::WIVE_ISA
