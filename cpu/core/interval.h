// Where along a ray hits count.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>

namespace wive {

// The float nearest to x on the side of -infinity, and of infinity.
[[gnu::always_inline]] inline float float_below(double x) {
    const float f = static_cast<float>(x);
    if (!(f > x)) return f;
    const auto bits = std::bit_cast<std::int32_t>(f);  // not zero: that is above x only where x rounds to -0
    if (f == 0) return -std::numeric_limits<float>::denorm_min();
    return std::bit_cast<float>(bits > 0 ? bits - 1 : bits + 1);
}
[[gnu::always_inline]] inline float float_above(double x) { return -float_below(-x); }

// [tmin, tmax], closed. Boxes are met in float, from entry() to reach(), which no hit in the interval lies outside.
template <class Real>
struct Interval;

template <>
struct Interval<float> {
    float tmin, tmax;

    [[gnu::always_inline]] float entry() const { return tmin; }
    [[gnu::always_inline]] float reach() const { return tmax; }
    [[gnu::always_inline]] bool holds(float t) const { return t >= tmin && t <= tmax; }
    [[gnu::always_inline]] void end_at(float t) { tmax = t; }
    [[gnu::always_inline]] static Interval of(float tmin, float tmax) { return {tmin, tmax}; }
};

template <>
struct Interval<double> {
    double tmin, tmax;
    float box_tmin, box_tmax;

    [[gnu::always_inline]] float entry() const { return box_tmin; }
    [[gnu::always_inline]] float reach() const { return box_tmax; }
    [[gnu::always_inline]] bool holds(double t) const { return t >= tmin && t <= tmax; }
    [[gnu::always_inline]] void end_at(double t) {
        tmax = t;
        box_tmax = float_above(t);
    }
    [[gnu::always_inline]] static Interval of(double tmin, double tmax) {
        return {tmin, tmax, float_below(tmin), float_above(tmax)};
    }
};

}  // namespace wive
