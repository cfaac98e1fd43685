#include "traverse/exact_hit.h"

#include <cmath>

namespace wive {
namespace {

#include "traverse/exact_integer.inc"
#include "traverse/exact_intersection.inc"

ExactIntersection meet(const GivenRay& ray, const Corners& corners) {
    return {ray.origin, ray.direction, corners.v, ExactIntersection::unit_of(ray.origin, corners.v)};
}

}  // namespace

bool hits_exactly(const GivenRay& ray, const Corners& corners, bool perturb_edges, HitNumbers& numbers) {
    const ExactIntersection meeting = meet(ray, corners);
    if (!(perturb_edges ? meeting.hit_perturbed : meeting.hit)) return false;
    numbers = {meeting.t(), meeting.u(), meeting.v()};
    return true;
}

int compare_with_limit(const GivenRay& ray, const Corners& corners, float limit) {
    if (std::isinf(limit)) return limit > 0 ? -1 : 1;
    return meet(ray, corners).compare(limit);
}

int compare_distances(const GivenRay& ray, const Corners& one, const Corners& other) {
    const int unit = ExactIntersection::unit_of(ray.origin, other.v, ExactIntersection::unit_of(ray.origin, one.v));
    return ExactIntersection(ray.origin, ray.direction, one.v, unit)
        .compare(ExactIntersection(ray.origin, ray.direction, other.v, unit));
}

}  // namespace wive
