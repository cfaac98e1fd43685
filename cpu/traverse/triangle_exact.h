// Exact hits on four triangles: a filter in double with a proved error bound, and integer arithmetic when the filter
// can't decide. The constants are derived in docs/accuracy.md; e = 2^-53.
#pragma once

#include <cassert>
#include <cmath>
#include <limits>

#include "core/error_free.h"
#include "core/layout.h"
#include "traverse/exact_hit.h"
#include "traverse/frame.h"

namespace wive::WIVE_ISA {

// A ray with the caller's own numbers, because scaling a direction is not exact if its components differ by more than
// the range of float, and because t must be rounded in the caller's units.
template <Isa I>
struct ExactFrame : AxisFrame<I> {
    float caller_direction[3];
    float caller_tmin, caller_tmax;
    double from[3];       // the origin on axis[0], axis[1] and axis[2]
    double shear[2];      // the direction on axis[0] and axis[1] / that on axis[2]
    double inverse;       // 1 / the direction on axis[2]
    double weight_bound;  // no weight of any triangle in the tree is off by more
    float box_start;      // t where the ray starts for boxes

    [[gnu::always_inline]] bool load(const BvhView& bvh, const RayBatch<float>& rays, std::size_t i) {
        // Read once: the arrays are the caller's, and another thread may write to them.
        float caller_origin[3];
        for (std::size_t k = 0; k < 3; ++k) {
            caller_origin[k] = rays.origins[3 * i + k];
            caller_direction[k] = rays.directions[3 * i + k];
        }
        caller_tmin = rays.tmin[i * rays.tmin_stride];
        caller_tmax = rays.tmax[i * rays.tmax_stride];
        if (!AxisFrame<I>::load(bvh, {caller_origin, caller_direction, &caller_tmin, &caller_tmax, 0, 0}, 0))
            [[unlikely]]
            return false;
        using Float4 = typename I::Float4;
        const auto& axis = this->axis;
        const float* d = caller_direction;
        for (int k = 0; k < 3; ++k) from[k] = caller_origin[axis[k]];
        inverse = 1.0 / d[axis[2]];
        // A t may have been rounded into the interval; the slack of the boxes covers that unless t is subnormal or
        // infinite.
        const float unscale = this->unscale;
        if (!this->scales_exactly(caller_tmin, caller_tmax, caller_tmin * unscale, caller_tmax * unscale))
            [[unlikely]] {
            constexpr float step = 0x1p-148f, most = std::numeric_limits<float>::max();
            const float low = caller_tmin < most ? caller_tmin : most, high = caller_tmax > -most ? caller_tmax : -most;
            this->interval = Interval<float>::of((low - step) * unscale, (high + step) * unscale);
        }
        shear[0] = slope(d[axis[0]] * inverse);
        shear[1] = slope(d[axis[1]] * inverse);
        // 96 e M^2, M (magnitude) no less than the distance of any corner from the origin along an axis.
        const Float4 relative = Float4::load(this->origin) - Float4::load(bvh.center);
        const double magnitude = highest_lane(Float4::load(bvh.extent) + abs(relative));
        weight_bound = 97 * 0x1p-53 * magnitude * magnitude;  // 97: magnitude itself is rounded
        box_start = 0;
        if (highest_lane(abs(relative)) > bvh.far_away) [[unlikely]] {
            box_start = this->bring_boxes_near(bvh);
            if (box_start != 0)
                this->interval = Interval<float>::of(-exact_box_tmax(-this->interval.tmin, -box_start),
                                                     exact_box_tmax(this->interval.tmax, box_start));
        }
        return true;
    }
    bool has_box_start() const { return box_start != 0; }

    CallerRay caller_ray() const {
        return {{this->origin[0], this->origin[1], this->origin[2]},
                {caller_direction[0], caller_direction[1], caller_direction[2]}};
    }

private:
    // Smaller slopes move corners by less than rounding does; without them no product underflows.
    [[gnu::always_inline]] static double slope(double s) { return std::fabs(s) < 0x1p-100 ? 0.0 : s; }
};

template <class I>
class ExactTriangles {
    using Float4 = typename I::Float4;
    using Double4 = typename I::Double4;

public:
    using Frame = ExactFrame<I>;
    static constexpr bool hits_are_in_boxes = true;  // up to the slack of frame.h

    [[gnu::always_inline]] explicit ExactTriangles(const Frame& ray) : ray_(ray) {}

    // The lanes of a block that may be hit, and what solve() needs for t, u and v.
    struct Found {
        unsigned hit_mask;
        Double4 x[3], y[3], z[3], weight[3];
    };

    template <class Corners>
    [[gnu::always_inline]] Found find(const Corners& corners) const {
        Found found;
        auto& [hit_mask, x, y, z, weight] = found;
        const Double4 shear_x = Double4::all(ray_.shear[0]), shear_y = Double4::all(ray_.shear[1]);
        for (unsigned k = 0; k < 3; ++k) {
            const auto away = [&](int i) {
                return widen(corners.vertex(k, ray_.axis[i])) - Double4::all(ray_.from[i]);
            };
            z[k] = away(2);
            x[k] = away(0) - shear_x * z[k];
            y[k] = away(1) - shear_y * z[k];
        }
        weigh(found);
        const Double4 low = lowest(weight), high = highest(weight);
        const Double4 bound = Double4::all(ray_.weight_bound), minus_bound = Double4::all(-ray_.weight_bound);
        hit_mask = corners.used(less_equal(minus_bound, low) | less_equal(high, bound));
        return found;
    }

    // Offers the hits to the query; true once the query is done.
    template <class Corners, RayQuery<float> Query>
    [[gnu::always_inline]] bool solve(const Corners& corners, const Found& found, Query& query) const {
        Decided decided = decide<Query::wants_uv>(corners, found, 1.0, tmax(query));
        if ((decided.hit_mask & decided.doubt) != 0) [[unlikely]]
            decide_in_pairs<Query::wants_uv>(corners, tmax(query), decided);
        for (unsigned rest = decided.hit_mask; rest != 0; rest &= rest - 1) {
            const int lane = __builtin_ctz(rest);
            RoundedHit hit = {decided.t[lane], decided.u[lane], decided.v[lane]};
            if (decided.doubt >> lane & 1u) [[unlikely]] {
                if (!hits_exactly(ray_.caller_ray(), corners_of(corners.block, lane), query.crossings, hit)) continue;
            }
            assert(corners.block.prim_at(lane) >= 0);
            if (!within_limits(hit.t)) continue;
            hit.t += 0.0f;  // no -0
            if (accept(corners.block, lane, hit, query)) return true;
        }
        return false;
    }

private:
    static constexpr double e = 0x1p-53;

    // The lanes that are hit or may be, those of them that are in doubt, and the numbers of the others.
    struct Decided {
        unsigned hit_mask = 0, doubt = 0;
        alignas(16) float t[4], u[4] = {}, v[4] = {};
    };

    // share: the error of x and y that comes from z, over that in find().
    template <bool wants_uv, class Corners>
    [[gnu::always_inline]] Decided decide(const Corners& corners, const Found& found, double share, float tmax) const {
        Decided decided;
        const auto& [may_be_hit, x, y, z, weight] = found;
        const Double4 low = lowest(weight), high = highest(weight), near = lowest(z), far = highest(z);
        // The error of these weights: e (r + 4 e Z) (13 r + 21 Z), with the share of Z.
        const Double4 along = max(abs(near), abs(far)), z_share = along * Double4::all(share);
        Double4 aside = max(abs(x[0]), abs(y[0]));
        for (int k = 1; k < 3; ++k) aside = max(aside, max(abs(x[k]), abs(y[k])));
        const Double4 error =
            (aside + Double4::all(4 * e) * z_share) * (Double4::all(13 * e) * aside + Double4::all(21 * e) * z_share);
        const Double4 minus_error = Double4::all(0.0) - error;
        unsigned hit_mask = may_be_hit & (less_equal(minus_error, low) | less_equal(high, error));
        const unsigned on_edge = less_equal(low, error) & less_equal(minus_error, high);  // or may be
        if ((hit_mask & on_edge) != 0) [[unlikely]]
            hit_mask &= ~ray_.edge_on(corners, ray_.caller_direction);
        if (hit_mask == 0) return decided;

        const Double4 inverse_det = Double4::all(1.0) / (weight[0] + weight[1] + weight[2]);
        const Double4 depth = (weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2]) * inverse_det;
        const Double4 weight_error = Double4::all(6.0) * error * abs(inverse_det);
        const Double4 depth_error = weight_error * (far - near) + Double4::all(12 * e) * along;
        const Double4 inverse = Double4::all(ray_.inverse);
        const Rounded t(depth * inverse, depth_error * abs(inverse));
        // Drops certain misses before the exact test: most doubtful hits are on the surface that a ray starts from, and
        // lie outside its interval.
        hit_mask &= on_edge | ~(less(t.high, Float4::all(ray_.caller_tmin)) | less(Float4::all(tmax), t.low));
        if (hit_mask == 0) return decided;
        unsigned doubt = on_edge | t.store(decided.t) | equal(t.low, Float4::all(0.0f));  // the sign of zero matters
        if constexpr (wants_uv) {
            doubt |= Rounded(weight[1] * inverse_det, weight_error).store(decided.u);
            doubt |= Rounded(weight[2] * inverse_det, weight_error).store(decided.v);
        }
        decided.hit_mask = hit_mask;
        decided.doubt = doubt;
        return decided;
    }

    // Decides the lanes in doubt again, from corners that are rounded once. If the ray comes from afar, or the triangle
    // is large and the ray passes close to an edge, what rounding in find() left open is mostly decided then.
    template <bool wants_uv, class Corners>
    [[gnu::noinline]] void decide_in_pairs(const Corners& corners, float tmax, Decided& decided) const {
        constexpr double share = 16 * e;
        const unsigned lanes = decided.hit_mask & decided.doubt;
        const Decided again = decide<wants_uv>(corners, find_in_pairs(corners.block, lanes), share, tmax);
        decided.hit_mask = (decided.hit_mask & ~lanes) | again.hit_mask;
        decided.doubt = again.doubt & lanes;
        for (unsigned rest = again.hit_mask; rest != 0; rest &= rest - 1) {
            const int lane = __builtin_ctz(rest);
            decided.t[lane] = again.t[lane];
            decided.u[lane] = again.u[lane];
            decided.v[lane] = again.v[lane];
        }
    }

    // A number as the sum of two doubles: itself rounded, and what rounding took off.
    struct Pair {
        double high, low;

        [[gnu::always_inline]] static Pair difference(double a, double b) {
            return {a - b, rounded_off_sum(a, -b, a - b)};
        }
        [[gnu::always_inline]] static Pair quotient(double a, double b) {
            const double q = a / b, product = q * b;
            return {q, ((a - product) - rounded_off_product(q, b, product)) / b};
        }
        // a - b c
        [[gnu::always_inline]] static double without_product(Pair a, Pair b, Pair c) {
            const double product = b.high * c.high;
            const double low = rounded_off_product(b.high, c.high, product) + (b.high * c.low + b.low * c.high);
            const Pair rest = difference(a.high, product);
            return rest.high + (rest.low + (a.low - low));
        }
    };

    // What find() finds in some lanes of a block, with all but the last rounding of x and y in pairs.
    template <class Block>
    [[gnu::always_inline]] Found find_in_pairs(const Block& block, unsigned lanes) const {
        alignas(32) double x[3][4] = {}, y[3][4] = {}, z[3][4] = {};
        const float* direction = ray_.caller_direction;
        const auto slope = [&](int i) { return Pair::quotient(direction[ray_.axis[i]], direction[ray_.axis[2]]); };
        const Pair shear_x = slope(0), shear_y = slope(1);
        for (unsigned rest = lanes; rest != 0; rest &= rest - 1) {
            const int lane = __builtin_ctz(rest);
            for (int k = 0; k < 3; ++k) {
                const auto away = [&](int i) {
                    return Pair::difference(block.vertex(k, static_cast<int>(ray_.axis[i]), lane), ray_.from[i]);
                };
                const Pair depth = away(2);
                x[k][lane] = Pair::without_product(away(0), shear_x, depth);
                y[k][lane] = Pair::without_product(away(1), shear_y, depth);
                z[k][lane] = depth.high;
            }
        }
        Found found;
        found.hit_mask = lanes;
        for (int k = 0; k < 3; ++k) {
            found.x[k] = Double4::load(x[k]);
            found.y[k] = Double4::load(y[k]);
            found.z[k] = Double4::load(z[k]);
        }
        weigh(found);
        return found;
    }

    [[gnu::always_inline]] static void weigh(Found& found) {
        const auto& [hit_mask, x, y, z, weight] = found;
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            found.weight[k] = x[i] * y[j] - y[i] * x[j];
        }
    }

    [[gnu::always_inline]] static Double4 lowest(const Double4 (&a)[3]) { return min(min(a[0], a[1]), a[2]); }
    [[gnu::always_inline]] static Double4 highest(const Double4 (&a)[3]) { return max(max(a[0], a[1]), a[2]); }

    template <class Block>
    [[gnu::noinline]] static TriangleCorners corners_of(const Block& block, int lane) {
        TriangleCorners one;
        for (int i = 0; i < 9; ++i) one.v[i] = block.vertex(i / 3, i % 3, lane);
        return one;
    }

    // The floats to which numbers within the error of x round: all are in [low, high].
    struct Rounded {
        Float4 low, high;

        [[gnu::always_inline]] Rounded(Double4 x, Double4 error)
            : low(Float4::narrow(x - error)), high(Float4::narrow(x + error)) {}
        // Stores the rounded numbers; returns the mask of the lanes in doubt.
        [[gnu::always_inline]] unsigned store(float (&rounded)[4]) const {
            (low + Float4::all(0.0f)).store(rounded);  // no -0
            return ~equal(low, high);
        }
    };

    // No hit beyond this is wanted.
    template <class Query>
    [[gnu::always_inline]] float tmax(const Query& query) const {
        if constexpr (Query::in_order)
            return query.best.t < ray_.caller_tmax ? query.best.t : ray_.caller_tmax;
        else
            return ray_.caller_tmax;
    }

    // Limits are compared with the rounded t. -0 is that of a hit behind the origin.
    [[gnu::always_inline]] bool within_limits(float t) const {
        const bool behind = t == 0 && __builtin_signbit(t) && ray_.caller_tmin == 0;
        return t >= ray_.caller_tmin && t <= ray_.caller_tmax && !behind;
    }

    template <class Block, class Query>
    [[gnu::always_inline]] bool accept(const Block& block, int lane, const RoundedHit& hit, Query& query) const {
        if constexpr (CountingQuery<Query>)
            return query.take(1);
        else if constexpr (Query::in_order)
            return query.accept(hit, block, lane, ray_, [&](const Block& other, int other_lane) {
                return compare_distances(ray_.caller_ray(), corners_of(block, lane), corners_of(other, other_lane));
            });
        else
            return query.accept(hit.t, hit.u, hit.v, static_cast<std::uint32_t>(block.prim_at(lane)));
    }

    const Frame& ray_;
};

}  // namespace wive::WIVE_ISA
