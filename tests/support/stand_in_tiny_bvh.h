// What the bench against tinybvh uses of its interface, over all triangles of the mesh.
#pragma once
#include <cmath>
#include <cstdint>
#include <vector>
#define BVH_FAR 1e30f
namespace tinybvh {
struct bvhvec3 {
    float x, y, z;
};
struct bvhvec4 {
    float x, y, z, w;
    bvhvec4(float a, float b, float c, float d) : x(a), y(b), z(c), w(d) {}
};
struct bvhvec4slice {
    const bvhvec4* data;
    bvhvec4slice(const bvhvec4* d, std::uint32_t) : data(d) {}
};
struct Ray {
    bvhvec3 O, D;
    struct {
        float t;
    } hit;
    Ray(bvhvec3 o, bvhvec3 d, float t) : O(o), D(d), hit{t} {}
};
class BVH8_CPU {
public:
    void Build(const bvhvec4slice& v, const std::uint32_t* f, std::uint32_t n) { v_ = v.data, f_ = f, n_ = n; }
    void BuildHQ(const bvhvec4slice& v, const std::uint32_t* f, std::uint32_t n) { Build(v, f, n); }
    int Intersect(Ray& ray) const {
        for (std::uint32_t i = 0; i < n_; ++i) {
            double e[3][3];
            for (int k = 0; k < 3; ++k) {
                const bvhvec4& v = v_[f_[3 * i + k]];
                e[k][0] = v.x, e[k][1] = v.y, e[k][2] = v.z;
            }
            const double o[3] = {ray.O.x, ray.O.y, ray.O.z}, d[3] = {ray.D.x, ray.D.y, ray.D.z};
            double a[3], b[3], s[3];
            for (int k = 0; k < 3; ++k) a[k] = e[1][k] - e[0][k], b[k] = e[2][k] - e[0][k], s[k] = o[k] - e[0][k];
            const double p[3] = {d[1] * b[2] - d[2] * b[1], d[2] * b[0] - d[0] * b[2], d[0] * b[1] - d[1] * b[0]};
            const double q[3] = {s[1] * a[2] - s[2] * a[1], s[2] * a[0] - s[0] * a[2], s[0] * a[1] - s[1] * a[0]};
            const double n = a[0] * p[0] + a[1] * p[1] + a[2] * p[2];
            const double u = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) / n;
            const double v = (d[0] * q[0] + d[1] * q[1] + d[2] * q[2]) / n;
            const double t = (b[0] * q[0] + b[1] * q[1] + b[2] * q[2]) / n;
            if (u >= 0 && v >= 0 && u + v <= 1 && t >= 0 && t < ray.hit.t) ray.hit.t = float(t);
        }
        return 1;
    }
    bool IsOccluded(const Ray& ray) const {
        Ray copy = ray;
        Intersect(copy);
        return copy.hit.t < ray.hit.t;
    }

private:
    const bvhvec4* v_ = nullptr;
    const std::uint32_t* f_ = nullptr;
    std::uint32_t n_ = 0;
};
}  // namespace tinybvh
