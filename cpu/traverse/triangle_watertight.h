// Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", on four triangles.
//
// Vertices are moved into a space where the ray is the z axis: A_x = (a_x - o_x) - S_x (a_z - o_z). Rounding moves a
// vertex there by at most 6u max|a - o| (u = 2^-24), but it moves it alike for every triangle that shares it, so
// the mesh stays closed. The edge functions then have the exact sign of the rounded corners: a difference of two
// rounded products that is not zero has the sign of the exact one, because rounding is monotonic, and where it is
// zero the products are taken again in double, where they are exact. Fused multiply-adds would break that symmetry.
// Scenes of doubles have the same test in double, u = 2^-53, and triangle_watertight_float64.h for what follows.
#pragma once

#include <cmath>

#include "core/layout.h"
#include "traverse/frame.h"
#include "traverse/query.h"
#include "traverse/triangle_watertight_float64.h"

namespace wive {

// What the test needs of a ray besides: the shear that makes it the z axis.
template <class Isa>
struct WatertightFrame : AxisFrame<Isa> {
    using Real = typename Isa::Real;
    Real shear[2];

    [[gnu::always_inline]] bool load(const BvhView& bvh, const RayBatch<Real>& rays, std::size_t i) {
        if (!AxisFrame<Isa>::load(bvh, rays, i)) [[unlikely]]
            return false;
        for (int k = 0; k < 2; ++k) {
            shear[k] = this->direction[this->axis[k]] / this->direction[this->axis[2]];
            // Smaller slopes move nothing by as much as rounding does; without them no product underflows.
            if constexpr (sizeof(Real) == sizeof(double)) shear[k] = std::fabs(shear[k]) < 0x1p-100 ? 0.0 : shear[k];
        }
        return true;
    }
};

template <class Isa>
class WatertightTriangles {
    using Real = typename Isa::Real;
    using Real4 = typename Isa::Real4;
    using Float4 = typename Isa::Float4;
    using Double4 = typename Isa::Double4;

public:
    using Frame = WatertightFrame<Isa>;
    static constexpr bool hits_are_in_boxes = true;  // made larger by the slack of frame.h

    [[gnu::always_inline]] explicit WatertightTriangles(const Frame& ray) : ray_(ray) {
        for (int k = 0; k < 3; ++k) axis_[k] = ray.axis[k];
        for (int k = 0; k < 2; ++k) shear_[k] = ray.shear[k];
        for (int k = 0; k < 3; ++k) origin_[k] = Real4::all(ray.origin[axis_[k]]);
    }

    // The lanes of a block that may be hit, and what solve() needs to say where.
    struct FoundFloats {
        unsigned lanes, ties;  // ties: where rounding may have hidden a sign
        Float4 side;           // negative where the edge functions are
    };
    struct FoundDoubles {
        unsigned lanes;  // the rest is taken again, which costs less than to keep it for every block
    };
    using Found = std::conditional_t<precision_of<Real> == Precision::float64, FoundDoubles, FoundFloats>;

    template <class Corners>
    [[gnu::always_inline]] Found find(const Corners& corners) const {
        const Sheared<Corners> sheared(*this, corners);
        const auto& [u, v, w] = sheared.weight;
        const Real4 low = min(min(u, v), w), high = max(max(u, v), w);
        const unsigned lanes = corners.used(one_sided(low, high));
        if constexpr (precision_of<Real> == Precision::float64) {
            return {lanes};
        } else {
            const Float4 zero = Float4::all(0);
            return {lanes, equal(low, zero) | equal(high, zero), low + zero};  // adding zero clears the sign of -0
        }
    }

    // Offers the hits to the query; true once the query is done.
    template <class Corners, class Query>
    [[gnu::always_inline]] bool solve(const Corners& corners, const Found& found, Query& query) const {
        if constexpr (precision_of<Real> == Precision::float64) {
            const Sheared<Corners> sheared(*this, corners);
            Solution64<Isa> hits;
            const unsigned lanes =
                hits.solve(found.lanes, sheared.x, sheared.y, sheared.z, sheared.weight, ray_.direction[axis_[2]]);
            return offer_lanes(corners.block, lanes, hits.t, hits.u, hits.v, query);
        } else {
            unsigned lanes = found.lanes;
            Float4 side = found.side;
            if (const unsigned ties = lanes & found.ties; ties != 0) [[unlikely]]
                lanes = resolve_zero_edges(corners.block, lanes, ties, side);
            alignas(16) float ts[4], us[4], vs[4];
            intersect(corners, lanes, side, ts, us, vs);
            return offer_lanes(corners.block, lanes, ts, us, vs, query);
        }
    }

private:
    // The corners where the ray is the z axis, and the edge functions.
    template <class Corners>
    struct Sheared {
        Real4 x[3], y[3], z[3], weight[3];

        [[gnu::always_inline]] Sheared(const WatertightTriangles& test, const Corners& corners) {
            const Real4 shear_x = Real4::all(test.shear_[0]), shear_y = Real4::all(test.shear_[1]);
            for (unsigned k = 0; k < 3; ++k) {
                z[k] = corners.vertex(k, test.axis_[2]) - test.origin_[2];
                x[k] = (corners.vertex(k, test.axis_[0]) - test.origin_[0]) - shear_x * z[k];
                y[k] = (corners.vertex(k, test.axis_[1]) - test.origin_[1]) - shear_y * z[k];
            }
            weight[0] = x[2] * y[1] - y[2] * x[1];
            weight[1] = x[0] * y[2] - y[0] * x[2];
            weight[2] = x[1] * y[0] - y[1] * x[0];
        }
    };

    // t, u and v in double, rounded once. The plane across the ray is scaled by the direction's longest component,
    // which spares the divisions. Where only the rounding of the corners let the ray in, a weight is on the wrong side
    // here: there the rounded triangle is what is hit, and t lies where its boxes are looked for.
    template <class Corners>
    [[gnu::always_inline]] void intersect(const Corners& corners, unsigned lanes, Float4 side, float (&ts)[4],
                                          float (&us)[4], float (&vs)[4]) const {
        const Double4 forward = Double4::all(ray_.direction[axis_[2]]);
        const Double4 shear_x = Double4::all(ray_.direction[axis_[0]]),
                      shear_y = Double4::all(ray_.direction[axis_[1]]);
        Double4 x[3], y[3], z[3], weight[3];
        for (unsigned k = 0; k < 3; ++k) {
            const auto away = [&](int i) { return widen(corners.vertex(k, axis_[i])) - widen(origin_[i]); };
            z[k] = away(2);
            x[k] = away(0) * forward - shear_x * z[k];
            y[k] = away(1) * forward - shear_y * z[k];
        }
        const Double4 sides = widen(side), zero = Double4::all(0.0);
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 2) % 3, j = (k + 1) % 3;
            weight[k] = flip_sign(x[i] * y[j] - y[i] * x[j], sides) + zero;  // no -0
        }
        const Double4 det = weight[0] + weight[1] + weight[2];
        const Double4 lowest = min(min(weight[0], weight[1]), weight[2]);
        const Double4 inverse = Double4::all(1.0) / det;
        const Double4 height = weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2];
        Float4::narrow(height / (det * forward)).store(ts);
        Float4::narrow(weight[1] * inverse).store(us);
        Float4::narrow(weight[2] * inverse).store(vs);
        const unsigned inside = less_equal(zero, lowest) & ~less_equal(det, zero);
        if (const unsigned rounded = lanes & ~inside; rounded != 0) [[unlikely]]
            intersect_rounded(corners.block, rounded, ts, us, vs);
    }

    // Decides the lanes in which rounding hid a sign; returns the lanes that remain.
    template <class Block>
    [[gnu::noinline]] unsigned resolve_zero_edges(const Block& block, unsigned lanes, unsigned ties,
                                                  Float4& side) const {
        alignas(16) float sides[4];
        side.store(sides);
        for (; ties != 0; ties &= ties - 1) {
            const int lane = __builtin_ctz(ties);
            double edges[3], z[3];
            exact_edges(block, lane, edges, z);
            const bool negative = edges[0] < 0 || edges[1] < 0 || edges[2] < 0;
            const bool positive = edges[0] > 0 || edges[1] > 0 || edges[2] > 0;
            if (negative == positive) lanes &= ~(1u << lane);  // on both sides, or edge-on
            sides[lane] = negative ? -1.0f : 1.0f;
        }
        side = Float4::load(sides);
        return lanes;
    }

    // The same for the triangle with rounded corners.
    template <class Block>
    [[gnu::noinline]] void intersect_rounded(const Block& block, unsigned lanes, float (&ts)[4], float (&us)[4],
                                             float (&vs)[4]) const {
        for (; lanes != 0; lanes &= lanes - 1) {
            const int lane = __builtin_ctz(lanes);
            double weight[3], z[3];
            exact_edges(block, lane, weight, z);
            const double det = weight[0] + weight[1] + weight[2];
            const double height = weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2];
            ts[lane] = static_cast<float>(height / (det * ray_.direction[axis_[2]]));
            us[lane] = static_cast<float>(weight[1] / det);
            vs[lane] = static_cast<float>(weight[2] / det);
        }
    }

    // The edge functions of one lane's rounded corners, with exact signs, and the corners' depths.
    template <class Block>
    [[gnu::noinline]] void exact_edges(const Block& block, int lane, double (&edges)[3], double (&depth)[3]) const {
        double x[3], y[3];
        for (int k = 0; k < 3; ++k) {
            const auto away = [&](std::size_t i) {
                return block.vertex(k, static_cast<int>(axis_[i]), lane) - ray_.origin[axis_[i]];
            };
            const float z = away(2);
            const float shifted_x = away(0) - shear_[0] * z, shifted_y = away(1) - shear_[1] * z;
            x[k] = shifted_x;
            y[k] = shifted_y;
            depth[k] = z;
        }
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 2) % 3, j = (k + 1) % 3;
            edges[k] = x[i] * y[j] - y[i] * x[j];
        }
    }

    const Frame& ray_;
    std::size_t axis_[3];  // the direction's longest axis last
    Real shear_[2];
    Real4 origin_[3];
};

}  // namespace wive
