// What lights a picture: a sky and a sun, and the directions that are sampled towards them.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/vec3.h"

namespace wive {

// The sun's radius as seen from the ground, the tangent of its angle: some four times the real one, for soft shadows.
inline constexpr float sun_radius = 0.02f;

// Sine and cosine on [-pi/4, pi/4] to float's precision, by their Taylor series: the same operations, and so the same
// bits, on every backend.
inline void sine_cosine(float x, float& sine, float& cosine) {
    const float s = x * x;
    sine = x * (1.0f + s * (-1.0f / 6 + s * (1.0f / 120 + s * (-1.0f / 5040 + s * (1.0f / 362880)))));
    cosine = 1.0f + s * (-0.5f + s * (1.0f / 24 + s * (-1.0f / 720 + s * (1.0f / 40320))));
}

struct OnDisk {
    float x, y;
};

// A uniformly distributed point of the unit disk: Shirley and Chiu's concentric map.
inline OnDisk on_disk(float random_a, float random_b) {
    constexpr float quarter_pi = 0.785398163f;
    const float a = 2 * random_a - 1, b = 2 * random_b - 1;
    const bool along_a = std::abs(a) > std::abs(b);
    const float radius = along_a ? a : b, other = along_a ? b : a;
    float sine = 0, cosine = 1;
    if (radius != 0) sine_cosine(quarter_pi * (other / radius), sine, cosine);
    return {radius * (along_a ? cosine : sine), radius * (along_a ? sine : cosine)};
}

// x along a tangent of the unit vector n, y along its bitangent: Duff et al. 2017, "Building an Orthonormal Basis,
// Revisited".
inline Vec3 across(Vec3 n, OnDisk place) {
    const float sign = std::copysign(1.0f, n.z), p = -1.0f / (sign + n.z), q = n.x * n.y * p;
    const Vec3 tangent = {1 + sign * n.x * n.x * p, sign * q, -sign * n.x}, bitangent = {q, sign + n.y * n.y * p, -n.y};
    return tangent * place.x + bitangent * place.y;
}

// A cosine-distributed direction about the unit normal n: a point of the disk, projected to the hemisphere.
inline Vec3 cosine_direction(Vec3 n, float random_a, float random_b) {
    const OnDisk place = on_disk(random_a, random_b);
    const float z = std::sqrt(std::max(0.0f, 1 - place.x * place.x - place.y * place.y));
    return across(n, place) + n * z;
}

struct Light {
    Vec3 up;               // unit
    Vec3 horizon, zenith;  // radiance of the sky, there and below, and straight up
    Vec3 to_sun;           // unit
    Vec3 sun;              // radiance of a white diffuse surface that faces the sun alone; zero: there is no sun

    bool has_sun() const { return sun.x > 0 || sun.y > 0 || sun.z > 0; }

    // The sky's radiance along a unit direction.
    Vec3 sky(Vec3 direction) const {
        const float height = std::sqrt(std::min(1.0f, std::max(0.0f, dot(up, direction))));
        return horizon + (zenith - horizon) * height;
    }

    // A direction to somewhere on the sun, of about length 1.
    Vec3 toward_sun(float random_a, float random_b) const {
        const OnDisk place = on_disk(random_a, random_b);
        return to_sun + across(to_sun, {place.x * sun_radius, place.y * sun_radius});
    }
};

inline constexpr Light white_sky = {{0, 0, 1}, {1, 1, 1}, {1, 1, 1}, {0, 0, 1}, {0, 0, 0}};

}  // namespace wive
