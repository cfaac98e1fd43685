#include "traverse/exact_hit.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "traverse/exact_int128.h"

namespace wive {
namespace {

namespace wide {
using Integer = BigInt;
#include "traverse/exact_intersection.inc"
}  // namespace wide

namespace narrow {
using Integer = Int128;
#include "traverse/exact_intersection.inc"
}  // namespace narrow

// The bits that integers of multiples of 2^unit need at most.
int bits_of(std::span<const float> values, int unit) {
    float largest = 0;
    for (const float x : values) largest = std::max(largest, std::fabs(x));
    return largest == 0 ? 0 : BigInt::exponent_of(largest) + 24 - unit;
}

// Whether Int128 holds every number of the intersection. Differences of coordinates have `size` bits and components of
// the direction `way`; then the height has 3 size + 3, and the determinant 2 size + way + 5.
bool fits_narrow(const CallerRay& ray, std::span<const float> corners, int unit) {
    const int size = std::max(bits_of(ray.origin, unit), bits_of(corners, unit)) + 1;
    const int way = bits_of(ray.direction, wide::ExactIntersection::unit_of(ray.direction, 3));
    return 3 * size + 3 <= 127 && 2 * size + way + 5 <= 127;
}

template <class Intersection>
bool hits(const Intersection& found, bool crossings, RoundedHit& hit) {
    if (!(crossings ? found.hit_perturbed : found.hit)) return false;
    hit = {found.t(), found.u(), found.v()};
    return true;
}

template <class Intersection>
int compare(const CallerRay& ray, const TriangleCorners& one, const TriangleCorners& other, int unit) {
    return Intersection(ray.origin, ray.direction, one.v, unit)
        .compare(Intersection(ray.origin, ray.direction, other.v, unit));
}

}  // namespace

bool hits_exactly(const CallerRay& ray, const TriangleCorners& corners, bool crossings, RoundedHit& hit) {
    const int unit = wide::ExactIntersection::unit_of(corners.v, 9, wide::ExactIntersection::unit_of(ray.origin, 3));
    if (fits_narrow(ray, corners.v, unit))
        return hits(narrow::ExactIntersection(ray.origin, ray.direction, corners.v, unit), crossings, hit);
    return hits(wide::ExactIntersection(ray.origin, ray.direction, corners.v, unit), crossings, hit);
}

int compare_distances(const CallerRay& ray, const TriangleCorners& one, const TriangleCorners& other) {
    if (wide::ExactIntersection::are_same(one.v, other.v)) return 0;
    using Narrow = narrow::ExactIntersection;
    using Wide = wide::ExactIntersection;
    const int unit = Wide::unit_of(other.v, 9, Wide::unit_of(one.v, 9, Wide::unit_of(ray.origin, 3)));
    const bool narrow = fits_narrow(ray, one.v, unit) && fits_narrow(ray, other.v, unit);
    return narrow ? compare<Narrow>(ray, one, other, unit) : compare<Wide>(ray, one, other, unit);
}

}  // namespace wive
