#include "traverse/exact_hit.h"

namespace wive {
namespace {

#include "traverse/exact_integer.inc"
#include "traverse/exact_intersection.inc"

ExactIntersection intersect(const CallerRay& ray, const TriangleCorners& corners) {
    return {ray.origin, ray.direction, corners.v, ExactIntersection::unit_of(ray.origin, corners.v)};
}

}  // namespace

bool hits_exactly(const CallerRay& ray, const TriangleCorners& corners, bool crossings, RoundedHit& hit) {
    const ExactIntersection found = intersect(ray, corners);
    if (!(crossings ? found.hit_perturbed : found.hit)) return false;
    hit = {found.t(), found.u(), found.v()};
    return true;
}

int compare_distances(const CallerRay& ray, const TriangleCorners& one, const TriangleCorners& other) {
    const int unit = ExactIntersection::unit_of(ray.origin, other.v, ExactIntersection::unit_of(ray.origin, one.v));
    return ExactIntersection(ray.origin, ray.direction, one.v, unit)
        .compare(ExactIntersection(ray.origin, ray.direction, other.v, unit));
}

}  // namespace wive
