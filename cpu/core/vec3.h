// Vectors of three floats, for shading, and the normal of a triangle.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace wive {

struct Vec3 {
    float x, y, z;

    friend Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
    friend Vec3 operator*(Vec3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
};

inline Vec3 load_vec3(const float* p) { return {p[0], p[1], p[2]}; }
inline float dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline Vec3 normalize(Vec3 a) { return a * (1.0f / std::sqrt(dot(a, a))); }
inline float largest_component(Vec3 a) { return std::fmax(std::fmax(std::abs(a.x), std::abs(a.y)), std::abs(a.z)); }

// (b - a) x (c - a): normal to the triangle, as long as twice its area. In double, in which the normal of a tiny or a
// huge triangle neither underflows nor overflows.
template <class Real>
std::array<double, 3> triangle_normal(const Real* a, const Real* b, const Real* c) {
    std::array<double, 3> u, v;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        u[axis] = static_cast<double>(b[axis]) - static_cast<double>(a[axis]);
        v[axis] = static_cast<double>(c[axis]) - static_cast<double>(a[axis]);
    }
    return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

template <class Real>
Vec3 unit_normal(const Real* a, const Real* b, const Real* c) {
    const auto [x, y, z] = triangle_normal(a, b, c);
    const double scale = 1.0 / std::sqrt(x * x + y * y + z * z);
    return {static_cast<float>(x * scale), static_cast<float>(y * scale), static_cast<float>(z * scale)};
}

}  // namespace wive
