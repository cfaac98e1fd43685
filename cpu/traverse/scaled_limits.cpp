#include "traverse/scaled_limits.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace wive {
namespace {

// The number at a place in the order of all floating-point numbers, of which -infinity is the first.
template <class Real, class Place>
Real number_at(Place place) {
    constexpr Place sign = Place{1} << (8 * sizeof(Place) - 1);
    const Place negative_infinity = ~std::bit_cast<Place>(-std::numeric_limits<Real>::infinity());
    place += negative_infinity;
    return std::bit_cast<Real>(place & sign ? place ^ sign : ~place);
}

// The largest t with t / unscale <= limit.
template <class Real>
Real largest_within(Real limit, Real unscale) {
    constexpr Real least = 2 * std::numeric_limits<Real>::min(), most = std::numeric_limits<Real>::max();
    const Real product = limit * unscale, smaller = std::min(std::abs(limit), std::abs(product)),
               larger = std::max(std::abs(limit), std::abs(product));
    if (limit > most || (smaller >= least && larger <= most)) return product;  // exact
    using Place = std::conditional_t<sizeof(Real) == sizeof(float), std::uint32_t, std::uint64_t>;
    const auto infinity = std::bit_cast<Place>(std::numeric_limits<Real>::infinity());
    Place low = 0, high = 2 * infinity + 1;  // -infinity and infinity
    while (low < high) {
        const Place middle = high - (high - low) / 2;
        if (number_at<Real>(middle) / unscale <= limit)
            low = middle;
        else
            high = middle - 1;
    }
    return number_at<Real>(low);
}

}  // namespace

template <class Real>
Interval<Real> scaled_limits(Real tmin, Real tmax, Real unscale) {
    const Real near = tmin == 0 ? Real{0} : -largest_within(-tmin, unscale);
    return Interval<Real>::of(near, largest_within(tmax, unscale));
}

template Interval<float> scaled_limits(float, float, float);
template Interval<double> scaled_limits(double, double, double);

}  // namespace wive
