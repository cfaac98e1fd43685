#include "traverse/exact_hit.h"

#include <cmath>

namespace wive {
namespace {

#include "traverse/exact_integer.inc"
#include "traverse/exact_meeting.inc"

Meeting meet(const GivenRay& ray, const Corners& corners) {
    return {ray.origin, ray.direction, corners.v, Meeting::unit_of(ray.origin, corners.v)};
}

}  // namespace

bool hits_exactly(const GivenRay& ray, const Corners& corners, bool crossings, HitNumbers& numbers) {
    const Meeting meeting = meet(ray, corners);
    if (!(crossings ? meeting.crosses : meeting.hit)) return false;
    numbers = {meeting.t(), meeting.u(), meeting.v()};
    return true;
}

int compare_with_limit(const GivenRay& ray, const Corners& corners, float limit) {
    if (std::isinf(limit)) return limit > 0 ? -1 : 1;
    return meet(ray, corners).compare(limit);
}

int compare_distances(const GivenRay& ray, const Corners& one, const Corners& other) {
    const int unit = Meeting::unit_of(ray.origin, other.v, Meeting::unit_of(ray.origin, one.v));
    return Meeting(ray.origin, ray.direction, one.v, unit).compare(Meeting(ray.origin, ray.direction, other.v, unit));
}

}  // namespace wive
