#include "build/far_away.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace wive {
namespace {

// Triangles looked at; more change the result by little.
constexpr std::size_t most_samples = 1024;

// The slack is 2^-20 of the distance.
constexpr int distance_exponent = 18;

}  // namespace

// The mean is geometric, so that a few large triangles under a fine detail don't count for more than they are.
template <class Real>
float far_away_from(const Mesh<Real>& mesh) {
    const std::size_t step = std::max<std::size_t>(1, mesh.face_count / most_samples);
    long sum = 0, count = 0;
    for (std::size_t face = 0; face < mesh.face_count; face += step) {
        Real corner[3][3], size = 0;
        if (!mesh.load_corners(face, corner)) continue;
        for (int axis = 0; axis < 3; ++axis) {
            const auto [low, high] = std::minmax({corner[0][axis], corner[1][axis], corner[2][axis]});
            size = std::max(size, high - low);
        }
        if (!(size > 0)) continue;
        sum += std::ilogb(size);
        ++count;
    }
    if (count == 0) return std::numeric_limits<float>::infinity();
    const long exponent = sum / count + distance_exponent;
    return std::ldexp(1.0f, static_cast<int>(std::clamp(exponent, -120L, 120L)));
}

template float far_away_from(const Mesh<float>&);
template float far_away_from(const Mesh<double>&);

// Beyond 256 radii, float32 moves a ray by up to 1e-4 radii, which may be more than a typical triangle's size before.
// Coordinates of the scene themselves are rounded by as much as distances up to those of its middle.
Distant distant_from(const Bounds& bounds, float far_away) {
    const auto& [low, high] = bounds;
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const double radius = 0.5 * std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    if (!(radius < infinity)) return {{}, infinity};
    Distant distant = {{}, std::clamp<double>(far_away, 2 * radius, 256 * radius)};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        distant.center[axis] = 0.5 * low[axis] + 0.5 * high[axis];
        distant.far = std::max(distant.far, std::abs(distant.center[axis]));
    }
    return distant;
}

template <class Real>
bool Distant::may_hold(const Real* origins, std::size_t count) const {
    const auto [least, most] = std::minmax({center[0], center[1], center[2]});
    const auto lowest = static_cast<Real>(most - far), highest = static_cast<Real>(least + far);
    unsigned beyond = 0;  // no early end, so that the loop runs on vectors
    for (std::size_t i = 0; i < 3 * count; ++i)
        beyond |= static_cast<unsigned>(origins[i] <= lowest) | static_cast<unsigned>(origins[i] >= highest);
    return beyond != 0;
}

template bool Distant::may_hold(const float*, std::size_t) const;
template bool Distant::may_hold(const double*, std::size_t) const;

}  // namespace wive
