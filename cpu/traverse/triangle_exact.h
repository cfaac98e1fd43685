// Exact hits on four triangles: a filter in double whose error is bounded, and integers where it leaves a doubt. The
// constants are derived in docs/accuracy.md; e = 2^-53.
#pragma once

#include <cmath>

#include "core/layout.h"
#include "traverse/exact_hit.h"
#include "traverse/frame.h"

namespace wive {

// What the exact test needs of a ray besides: the caller's own numbers, because scaling a direction whose components
// differ by more than float's range is not exact, and t has to be rounded in the caller's units.
template <class Isa>
struct ExactFrame : AxisFrame<Isa> {
    float given_direction[3];
    float given_tmin, given_tmax;
    float unscale;    // t here = unscale * t of the caller's ray
    double from[3];   // the origin, in the order of the axes, as the next two are
    double shear[2];  // the direction over that on the longest axis
    double inverse;   // 1 / the direction on the longest axis
    double bound;     // no weight in the whole tree is off by more

    [[gnu::always_inline]] bool load(const BvhView& bvh, const RayBatch<float>& rays, std::size_t i) {
        if (!AxisFrame<Isa>::load(bvh, rays, i)) [[unlikely]]
            return false;
        using Float4 = typename Isa::Float4;
        const auto& axis = this->axis;
        const float *o = rays.origins + 3 * i, *d = rays.directions + 3 * i;
        for (int k = 0; k < 3; ++k) {
            given_direction[k] = d[k];
            from[k] = o[axis[k]];
        }
        given_tmin = rays.tmin[i * rays.tmin_stride];
        given_tmax = rays.tmax[i * rays.tmax_stride];
        unscale = 1.0f / this->scale;
        inverse = 1.0 / d[axis[2]];
        shear[0] = slope(d[axis[0]] * inverse);
        shear[1] = slope(d[axis[1]] * inverse);
        // 96 e M^2, M no less than the distance of any corner from the origin along an axis.
        const Float4 relative = Float4::load(this->origin) - Float4::load(bvh.center);
        const double reach = highest_lane(Float4::load(bvh.extent) + abs(relative));
        bound = 97 * 0x1p-53 * reach * reach;  // one more for reach's own rounding
        return true;
    }

    GivenRay given() const {
        return {{this->origin[0], this->origin[1], this->origin[2]},
                {given_direction[0], given_direction[1], given_direction[2]}};
    }

private:
    // Smaller slopes move nothing by as much as rounding does; without them no product underflows.
    [[gnu::always_inline]] static double slope(double s) { return std::fabs(s) < 0x1p-100 ? 0.0 : s; }
};

template <class Isa>
class ExactTriangles {
    using Float4 = typename Isa::Float4;
    using Double4 = typename Isa::Double4;

public:
    using Frame = ExactFrame<Isa>;
    static constexpr bool hits_are_in_boxes = true;  // made larger by the slack of frame.h

    [[gnu::always_inline]] explicit ExactTriangles(const Frame& ray) : ray_(ray) {}

    // The lanes of a block that may be hit, and what solve() needs to say where.
    struct Found {
        unsigned lanes;
        Double4 x[3], y[3], z[3], weight[3];
    };

    template <class BlockCorners>
    [[gnu::always_inline]] Found find(const BlockCorners& corners) const {
        Found found;
        auto& [lanes, x, y, z, weight] = found;
        const Double4 shear_x = Double4::all(ray_.shear[0]), shear_y = Double4::all(ray_.shear[1]);
        for (unsigned k = 0; k < 3; ++k) {
            const auto away = [&](int i) {
                return widen(corners.vertex(k, ray_.axis[i])) - Double4::all(ray_.from[i]);
            };
            z[k] = away(2);
            x[k] = away(0) - shear_x * z[k];
            y[k] = away(1) - shear_y * z[k];
        }
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            weight[k] = x[i] * y[j] - y[i] * x[j];
        }
        const Double4 low = lowest(weight), high = highest(weight);
        lanes = corners.used(less_equal(Double4::all(-ray_.bound), low) | less_equal(high, Double4::all(ray_.bound)));
        return found;
    }

    // Offers the hits to the query; true once the query is done.
    template <class BlockCorners, class Query>
    [[gnu::always_inline]] bool solve(const BlockCorners& corners, const Found& found, Query& query) const {
        const auto& [may_be_hit, x, y, z, weight] = found;
        const Double4 low = lowest(weight), high = highest(weight), near = lowest(z), far = highest(z);
        constexpr double e = 0x1p-53;
        // The error of these weights: e (r + 4 e Z) (13 r + 21 Z).
        const Double4 along = max(abs(near), abs(far));
        Double4 aside = max(abs(x[0]), abs(y[0]));
        for (int k = 1; k < 3; ++k) aside = max(aside, max(abs(x[k]), abs(y[k])));
        const Double4 error =
            (aside + Double4::all(4 * e) * along) * (Double4::all(13 * e) * aside + Double4::all(21 * e) * along);
        const Double4 minus_error = Double4::all(0.0) - error;
        unsigned lanes = may_be_hit & (less_equal(minus_error, low) | less_equal(high, error));
        if (lanes == 0) return false;

        const unsigned on_edge = less_equal(low, error) & less_equal(minus_error, high);  // maybe
        const Double4 share = Double4::all(1.0) / (weight[0] + weight[1] + weight[2]);
        const Double4 depth = (weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2]) * share;
        const Double4 weight_error = Double4::all(6.0) * error * abs(share);
        const Double4 depth_error = weight_error * (far - near) + Double4::all(12 * e) * along;
        const Double4 inverse = Double4::all(ray_.inverse);
        const Rounded t(depth * inverse, depth_error * abs(inverse));
        // Most doubts are about where a ray meets the surface that it leaves from, which does not matter.
        lanes &= on_edge | ~(less(t.high, Float4::all(ray_.given_tmin)) | less(Float4::all(farthest(query)), t.low));
        if (lanes == 0) return false;

        alignas(16) float ts[4], us[4] = {}, vs[4] = {};
        unsigned doubt = on_edge | t.store(ts);
        if constexpr (Query::wants_uv) {
            doubt |= Rounded(weight[1] * share, weight_error).store(us);
            doubt |= Rounded(weight[2] * share, weight_error).store(vs);
        }
        for (; lanes != 0; lanes &= lanes - 1) {
            const int lane = __builtin_ctz(lanes);
            HitNumbers hit = {ts[lane], us[lane], vs[lane]};
            if (doubt >> lane & 1u) [[unlikely]] {
                if (!hits_exactly(ray_.given(), corners_of(corners.block, lane), Query::perturb_edges, hit)) continue;
            }
            if (!within_limits(corners.block, lane, hit.t)) continue;
            if (offer(corners.block, lane, hit, query)) return true;
        }
        return false;
    }

private:
    [[gnu::always_inline]] static Double4 lowest(const Double4 (&a)[3]) { return min(min(a[0], a[1]), a[2]); }
    [[gnu::always_inline]] static Double4 highest(const Double4 (&a)[3]) { return max(max(a[0], a[1]), a[2]); }

    template <class Block>
    [[gnu::noinline]] static Corners corners_of(const Block& block, int lane) {
        Corners one;
        for (int i = 0; i < 9; ++i) one.v[i] = block.vertex(i / 3, i % 3, lane);
        return one;
    }

    // What numbers within the error of x round to.
    struct Rounded {
        Float4 low, high;

        [[gnu::always_inline]] Rounded(Double4 x, Double4 error)
            : low(Float4::narrow(x - error)), high(Float4::narrow(x + error)) {}
        // Returns the lanes in doubt.
        [[gnu::always_inline]] unsigned store(float (&rounded)[4]) const {
            (low + Float4::all(0.0f)).store(rounded);  // no -0
            return ~equal(low, high);
        }
    };

    // No hit beyond can be asked for.
    template <class Query>
    [[gnu::always_inline]] float farthest(const Query& query) const {
        if constexpr (Query::in_order)
            return query.best.t < ray_.given_tmax ? query.best.t : ray_.given_tmax;
        else
            return ray_.given_tmax;
    }

    // Rounding keeps order, so only where t rounds to a limit can it have crossed it.
    template <class Block>
    [[gnu::always_inline]] bool within_limits(const Block& block, int lane, float t) const {
        if (t < ray_.given_tmin || t > ray_.given_tmax) return false;
        if (t == ray_.given_tmin) [[unlikely]]
            if (compare_with_limit(ray_.given(), corners_of(block, lane), t) < 0) return false;
        if (t == ray_.given_tmax) [[unlikely]]
            if (compare_with_limit(ray_.given(), corners_of(block, lane), t) > 0) return false;
        return true;
    }

    template <class Block, class Query>
    [[gnu::always_inline]] bool offer(const Block& block, int lane, const HitNumbers& hit, Query& query) const {
        if constexpr (Query::in_order)
            return query.take(hit, block, lane, ray_.unscale, [&](const Block& other, int other_lane) {
                return compare_distances(ray_.given(), corners_of(block, lane), corners_of(other, other_lane));
            });
        else
            return query.take(hit.t, hit.u, hit.v, static_cast<std::uint32_t>(block.prim_at(lane)));
    }

    const Frame& ray_;
};

}  // namespace wive
