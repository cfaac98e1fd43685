// The limits of a ray in the units of its frame, when scaling them rounds or t itself under- or overflows.
#pragma once

#include "core/interval.h"

namespace wive {

// The t of the frame for which t / unscale, rounded as it is returned, lies in [tmin, tmax]; empty (tmin > tmax) if
// there is none. A negative t is below a tmin of zero even if t / unscale rounds to zero. unscale: a power of two.
// Slow, rarely needed, and compiled once for all instruction sets.
template <class Real>
Interval<Real> scaled_limits(Real tmin, Real tmax, Real unscale);

}  // namespace wive
