// Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", on four triangles.
//
// Vertices are transformed into a space in which the ray is the z axis: A_x = (a_x - o_x) - S_x (a_z - o_z). Rounding
// moves a vertex there by at most 6u max|a - o| (u = 2^-24), but by the same amount for every triangle that shares the
// vertex, so the mesh stays closed. The edge functions then have the exact sign for the rounded corners: a difference
// of two rounded products that is not zero has the sign of the exact one, because rounding is monotonic, and if it is
// zero, the products are computed again in double, in which they are exact. Fused multiply-adds would break that
// symmetry. Scenes of doubles use the same test in double, u = 2^-53; triangle_watertight_float64.h does the rest.
#pragma once

#include <cmath>

#include "core/layout.h"
#include "traverse/crossings.h"
#include "traverse/frame.h"
#include "traverse/query.h"
#include "traverse/triangle_watertight_float64.h"

namespace wive::WIVE_ISA {

// A ray with the shear that makes it the z axis.
template <Isa I>
struct WatertightFrame : AxisFrame<I> {
    using Real = typename I::Real;
    Real shear[2];

    [[gnu::always_inline]] bool load(const BvhView& bvh, const RayBatch<Real>& rays, std::size_t i) {
        if (!AxisFrame<I>::load(bvh, rays, i)) [[unlikely]]
            return false;
        for (int k = 0; k < 2; ++k) {
            shear[k] = this->direction[this->axis[k]] / this->direction[this->axis[2]];
            // Smaller slopes move corners by less than rounding does; without them no product underflows.
            if constexpr (sizeof(Real) == sizeof(double)) shear[k] = std::fabs(shear[k]) < 0x1p-100 ? 0.0 : shear[k];
        }
        return true;
    }
};

template <class I>
class WatertightTriangles {
    using Real = typename I::Real;
    using Real4 = typename I::Real4;
    using Float4 = typename I::Float4;
    using Double4 = typename I::Double4;

public:
    using Frame = WatertightFrame<I>;
    static constexpr bool hits_are_in_boxes = true;  // up to the slack of frame.h

    [[gnu::always_inline]] explicit WatertightTriangles(const Frame& ray) : ray_(ray) {
        for (int k = 0; k < 3; ++k) axis_[k] = ray.axis[k];
        for (int k = 0; k < 2; ++k) shear_[k] = ray.shear[k];
        for (int k = 0; k < 3; ++k) origin_[k] = Real4::all(ray.origin[axis_[k]]);
    }

    // The lanes of a block that may be hit, and what solve() needs for t, u and v.
    struct FoundFloats {
        unsigned hit_mask;
        unsigned zero_edges;  // the lanes with an edge function of zero, whose sign rounding may have hidden
        Float4 side;          // has the sign of the edge functions
    };
    struct FoundDoubles {
        unsigned hit_mask;  // solve() computes the rest again, which costs less than keeping it for every block
    };
    using Found = std::conditional_t<precision_of<Real> == Precision::float64, FoundDoubles, FoundFloats>;

    template <class Corners>
    [[gnu::always_inline]] Found find(const Corners& corners) const {
        const Sheared<Corners> sheared(*this, corners);
        const auto& [u, v, w] = sheared.weight;
        const Real4 low = min(min(u, v), w), high = max(max(u, v), w);
        const unsigned hit_mask = corners.used(one_sided(low, high));
        if constexpr (precision_of<Real> == Precision::float64) {
            return {hit_mask};
        } else {
            const Float4 zero = Float4::all(0);
            return {hit_mask, equal(low, zero) | equal(high, zero), low + zero};  // adding zero clears the sign of -0
        }
    }

    // Offers the hits to the query; true once the query is done.
    template <class Corners, OfferedQuery<Real> Query>
    [[gnu::always_inline]] bool solve(const Corners& corners, const Found& found, Query& query) const {
        if constexpr (precision_of<Real> == Precision::float64) {
            const unsigned may_be_hit = found.hit_mask & ~ray_.edge_on(corners, ray_.direction);
            if (may_be_hit == 0) return false;
            const Sheared<Corners> sheared(*this, corners);
            Float64Hits<I, Query::wants_uv> hits;
            const unsigned hit_mask = hits.solve(may_be_hit, sheared.x, sheared.y, sheared.z, sheared.weight,
                                                 ray_.direction[axis_[2]], query.crossings);
            return offer_lanes<I>(corners.block, hit_mask, hits.t, hits.u, hits.v, query);
        } else {
            unsigned hit_mask = found.hit_mask;
            Float4 side = found.side;
            if ((hit_mask & found.zero_edges) != 0) [[unlikely]] {
                hit_mask &= ~ray_.edge_on(corners, ray_.direction);
                hit_mask = resolve_zero_edges(corners.block, hit_mask, found.zero_edges, query.crossings, side);
                if (hit_mask == 0) return false;
            }
            alignas(16) float ts[4], us[4], vs[4];
            intersect<Query::wants_uv>(corners, hit_mask, side, ts, us, vs);
            return offer_lanes<I>(corners.block, hit_mask, ts, us, vs, query);
        }
    }

private:
    // The least sum of the weights that is trusted, relative to the largest of their products: rounding moves t by less
    // than 2^-24 of the triangle's depth then.
    static constexpr double least_weight = 0x1p-28;

    // The corners in the space in which the ray is the z axis, and the edge functions.
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

    // Computes t and, if wanted, u and v in double and rounds them once. x and y are scaled by the longest component of
    // the direction, which saves the divisions. If the ray hits only the triangle with rounded corners, a weight has
    // the wrong sign here, or all weights together are no more than rounding of their products leaves. t, u and v are
    // then those of the rounded triangle, whose weights are exact but for one rounding, so that t lies within the box
    // (frame.h).
    template <bool wants_uv, class Corners>
    [[gnu::always_inline]] void intersect(const Corners& corners, unsigned hit_mask, Float4 side, float (&ts)[4],
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
        Double4 largest = zero;
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 2) % 3, j = (k + 1) % 3;
            const Double4 product = x[i] * y[j];
            weight[k] = flip_sign(product - y[i] * x[j], sides) + zero;  // no -0
            largest = max(largest, abs(product));
        }
        const Double4 det = weight[0] + weight[1] + weight[2];
        const Double4 lowest = min(min(weight[0], weight[1]), weight[2]);
        const Double4 height = weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2];
        Float4::narrow(height / (det * forward)).store(ts);
        if constexpr (wants_uv) {
            const Double4 inverse = Double4::all(1.0) / det;
            Float4::narrow(weight[1] * inverse).store(us);
            Float4::narrow(weight[2] * inverse).store(vs);
        }
        const unsigned inside = less_equal(zero, lowest) & ~less_equal(det, largest * Double4::all(least_weight));
        if (const unsigned rounded = hit_mask & ~inside; rounded != 0) [[unlikely]]
            intersect_rounded(corners.block, rounded, ts, us, vs);
    }

    // Decides the lanes of the mask with an edge function of zero by exact signs; returns the hit mask and corrects
    // `side`.
    template <class Block>
    [[gnu::noinline]] unsigned resolve_zero_edges(const Block& block, unsigned hit_mask, unsigned zero_edges,
                                                  bool crossings, Float4& side) const {
        alignas(16) float sides[4];
        side.store(sides);
        for (unsigned rest = hit_mask & zero_edges; rest != 0; rest &= rest - 1) {
            const int lane = __builtin_ctz(rest);
            const RoundedTriangle rounded = round_corners(block, lane);
            const int passed = side_passed(rounded.x, rounded.y, rounded.edge, crossings);
            if (passed == 0) hit_mask &= ~(1u << lane);
            sides[lane] = static_cast<float>(passed);
        }
        side = Float4::load(sides);
        return hit_mask;
    }

    // Computes t, u and v of the triangle with rounded corners.
    template <class Block>
    [[gnu::noinline]] void intersect_rounded(const Block& block, unsigned hit_mask, float (&ts)[4], float (&us)[4],
                                             float (&vs)[4]) const {
        for (; hit_mask != 0; hit_mask &= hit_mask - 1) {
            const int lane = __builtin_ctz(hit_mask);
            const auto [x, y, z, weight] = round_corners(block, lane);
            const double det = weight[0] + weight[1] + weight[2];
            const double height = weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2];
            ts[lane] = static_cast<float>(height / (det * ray_.direction[axis_[2]]));
            us[lane] = static_cast<float>(weight[1] / det);
            vs[lane] = static_cast<float>(weight[2] / det);
        }
    }

    // One lane's rounded corners and edge functions, which have the exact sign.
    struct RoundedTriangle {
        double x[3], y[3], z[3], edge[3];
    };
    template <class Block>
    [[gnu::noinline]] RoundedTriangle round_corners(const Block& block, int lane) const {
        RoundedTriangle rounded;
        auto& [x, y, depth, edge] = rounded;
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
            edge[k] = x[i] * y[j] - y[i] * x[j];
        }
        return rounded;
    }

    const Frame& ray_;
    std::size_t axis_[3];  // the longest axis of the direction last
    Real shear_[2];
    Real4 origin_[3];
};

}  // namespace wive::WIVE_ISA
