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

}  // namespace wive
