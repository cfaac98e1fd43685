// Box planes relative to a tree's centre, rounded outwards: lower planes down, upper planes up, so that a box never
// shrinks.
#pragma once

#include <cmath>
#include <limits>

#include "core/error_free.h"
#include "core/interval.h"

namespace wive {

inline float plane_below(float plane, float center) {
    const float p = plane - center;
    const bool above = static_cast<double>(p) > static_cast<double>(plane) - center;
    return above ? std::nextafter(p, -std::numeric_limits<float>::infinity()) : p;
}
// The difference of doubles is rounded as well. Its rounding error decides if the rounded difference is a float.
inline float plane_below(double plane, float center) {
    const double b = -static_cast<double>(center), p = plane + b;
    const double rest = rounded_off_sum(plane, b, p);
    const float below = float_below(p);
    return static_cast<double>(below) == p && rest < 0 ? std::nextafter(below, -std::numeric_limits<float>::infinity())
                                                       : below;
}
template <class Real>
float plane_above(Real plane, float center) {
    return -plane_below(-plane, -center);
}

}  // namespace wive
