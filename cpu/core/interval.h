// The interval of a ray's parameter t in which hits count, and rounding to float towards either infinity.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

namespace wive {

// float_below: the largest float not above x. float_above: the smallest float not below x.
[[gnu::always_inline]] inline float float_below(double x) {
    const float f = static_cast<float>(x);
    if (!(f > x)) return f;
    // f > x and f == 0: a negative x was rounded to -0.
    if (f == 0) return -std::numeric_limits<float>::denorm_min();
    const auto bits = std::bit_cast<std::int32_t>(f);
    return std::bit_cast<float>(bits > 0 ? bits - 1 : bits + 1);
}
[[gnu::always_inline]] inline float float_above(double x) { return -float_below(-x); }

// The closed interval [tmin, tmax]. Slab tests are in float for either precision: box_tmin() and box_tmax() are the
// interval's ends rounded outwards, so that no box with a hit in the interval is missed. For boxes, a float64 ray may
// start elsewhere than for triangles (RayFrame::bring_boxes_near).
template <class Real>
struct Interval;

template <>
struct Interval<float> {
    float tmin, tmax;

    [[gnu::always_inline]] float box_tmin() const { return tmin; }
    [[gnu::always_inline]] float box_tmax() const { return tmax; }
    [[gnu::always_inline]] bool holds(float t) const { return t >= tmin && t <= tmax; }
    [[gnu::always_inline]] void end_at(float t) { tmax = t; }
    [[gnu::always_inline]] static Interval of(float tmin, float tmax) { return {tmin, tmax}; }
};

template <>
struct Interval<double> {
    double tmin, tmax;
    float tmin_below, tmax_above;
    double box_start = 0;  // t where the ray starts for boxes

    [[gnu::always_inline]] float box_tmin() const { return tmin_below; }
    [[gnu::always_inline]] float box_tmax() const { return tmax_above; }
    [[gnu::always_inline]] bool holds(double t) const { return t >= tmin && t <= tmax; }
    [[gnu::always_inline]] void end_at(double t) {
        tmax = t;
        tmax_above = float_above(t - box_start);
    }
    [[gnu::always_inline]] void start_boxes_at(double t) {
        box_start = t;
        tmin_below = float_below(tmin - t);
        tmax_above = float_above(tmax - t);
    }
    [[gnu::always_inline]] static Interval of(double tmin, double tmax) {
        return {tmin, tmax, float_below(tmin), float_above(tmax)};
    }
};

}  // namespace wive
