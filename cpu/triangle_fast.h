// Moeller and Trumbore 1997 on four triangles: fast, and as exact as a scene's numbers are. Neighbours may disagree on an edge.
#pragma once

#include "frame.h"
#include "layout.h"

namespace wive {

template <class Isa>
class FastTriangles {
    using Real = typename Isa::Real;
    using Real4 = typename Isa::Real4;

public:
    using Frame = RayFrame<Isa>;

    [[gnu::always_inline]] explicit FastTriangles(const RayFrame<Isa>& ray) {
        for (int axis = 0; axis < 3; ++axis) {
            origin_[axis] = Real4::all(ray.origin[axis]);
            direction_[axis] = Real4::all(ray.direction[axis]);
        }
    }

    // Offers every hit of the block to the query; true once the query is done.
    template <class Corners, class Query>
    [[gnu::always_inline]] bool test(const Corners& corners, Query& query) const {
        Real4 e1[3], e2[3], p[3], s[3], q[3];
        for (unsigned axis = 0; axis < 3; ++axis) {
            const Real4 v0 = corners.vertex(0, axis);
            e1[axis] = corners.edge(1, axis, v0);
            e2[axis] = corners.edge(2, axis, v0);
            s[axis] = origin_[axis] - v0;
        }
        cross(direction_, e2, p);
        cross(s, e1, q);
        const Real4 det = dot(e1, p), size = abs(det), zero = Real4::all(0);
        const Real4 u = flip_sign(dot(s, p), det), v = flip_sign(dot(direction_, q), det);
        // A determinant of zero (a ray in the triangle's plane) fails, and so does NaN (an unused lane): where u is
        // NaN and v is not, min gives v, but the sum is NaN.
        unsigned lanes = all_in_order(zero, min(u, v), u + v, size, zero, size);
        lanes = corners.used(lanes);
        if (lanes == 0) [[likely]] return false;
        alignas(4 * sizeof(Real)) Real ts[4], us[4], vs[4];
        for (Real4& component : q) component = component / size;  // first: the product of three lengths may overflow
        flip_sign(dot(e2, q), det).store(ts);
        (u / size).store(us);
        (v / size).store(vs);
        for (; lanes != 0; lanes &= lanes - 1) {
            const int lane = __builtin_ctz(lanes);
            if (query.offer(ts[lane], us[lane], vs[lane], static_cast<std::uint32_t>(corners.block.prim_at(lane)))) return true;
        }
        return false;
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

}  // namespace wive
