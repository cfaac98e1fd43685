// Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection", on four triangles.
//
// Vertices are moved into a space where the ray is the z axis: A_x = (a_x - o_x) - S_x (a_z - o_z). Rounding moves a
// vertex there by at most 6u max|a - o| (u = 2^-24), but it moves it alike for every triangle that shares it, so
// the mesh stays closed. The edge functions then have the exact sign of the rounded corners: a difference of two
// rounded products that is not zero has the sign of the exact one, because rounding is monotonic, and where it is
// zero the products are taken again in double, where they are exact. Fused multiply-adds would break that symmetry.
#pragma once

#include <cmath>

#include "frame.h"
#include "layout.h"

namespace wive {

template <class Isa>
class WatertightTriangles {
    using Float4 = typename Isa::Float4;

public:
    [[gnu::always_inline]] explicit WatertightTriangles(const RayFrame<Isa>& ray) : ray_(ray) {
        constexpr unsigned following = 0b001001;  // the axis after axis i, two bits each
        axis_[2] = ray.longest_axis;
        axis_[0] = following >> 2 * axis_[2] & 3u;
        axis_[1] = following >> 2 * axis_[0] & 3u;
        for (int k = 0; k < 2; ++k) shear_[k] = ray.direction[axis_[k]] / ray.direction[axis_[2]];
        for (int k = 0; k < 3; ++k) origin_[k] = Float4::all(ray.origin[axis_[k]]);
    }

    // Offers every hit of the block to the query; true once the query is done.
    template <class Query>
    [[gnu::always_inline]] bool test(const TriangleBlock& block, Query& query) const {
        Float4 x[3], y[3];
        const Float4 shear_x = Float4::all(shear_[0]), shear_y = Float4::all(shear_[1]);
        const float *row_x = block.rows[axis_[0]], *row_y = block.rows[axis_[1]], *row_z = block.rows[axis_[2]];
        for (int k = 0; k < 3; ++k) {
            const int vertex = 3 * block_width * k;
            const Float4 z = Float4::load(row_z + vertex) - origin_[2];
            x[k] = (Float4::load(row_x + vertex) - origin_[0]) - shear_x * z;
            y[k] = (Float4::load(row_y + vertex) - origin_[1]) - shear_y * z;
        }
        const Float4 u = x[2] * y[1] - y[2] * x[1];
        const Float4 v = x[0] * y[2] - y[0] * x[2];
        const Float4 w = x[1] * y[0] - y[1] * x[0];
        unsigned lanes = one_sided(min(min(u, v), w), max(max(u, v), w));
        if (lanes == 0) [[likely]] return false;
        alignas(16) float edges[3][4];
        u.store(edges[0]);
        v.store(edges[1]);
        w.store(edges[2]);
        for (; lanes != 0; lanes &= lanes - 1) {
            const int lane = __builtin_ctz(lanes);
            Point hit;
            if (solve(block, lane, edges, hit) &&
                query.offer(hit.t, hit.u, hit.v, static_cast<std::uint32_t>(block.prim[lane])))
                return true;
        }
        return false;
    }

private:
    struct Point {
        float t, u, v;
    };

    // Few lanes come this far. Signs that rounding hid are settled, then t, u and v are computed in double and
    // rounded once. Weights are clamped to the decided signs, so t stays within the triangle.
    [[gnu::always_inline]] bool solve(const TriangleBlock& block, int lane, const float (&edges)[3][4], Point& hit) const {
        bool negative = edges[0][lane] < 0;
        if (edges[0][lane] == 0 || edges[1][lane] == 0 || edges[2][lane] == 0) [[unlikely]] {
            double exact[3];
            exact_edges(block, lane, exact);
            negative = exact[0] < 0 || exact[1] < 0 || exact[2] < 0;
            const bool positive = exact[0] > 0 || exact[1] > 0 || exact[2] > 0;
            if (negative == positive) return false;  // on both sides, or edge-on
        }
        // The plane across the ray, scaled by the direction's longest component to spare the divisions.
        double x[3], y[3], z[3];
        const double forward = ray_.direction[axis_[2]];
        const double shear_x = ray_.direction[axis_[0]], shear_y = ray_.direction[axis_[1]];
        for (int k = 0; k < 3; ++k) {
            const auto away = [&](std::size_t i) {
                return static_cast<double>(block.rows[3 * k + static_cast<int>(axis_[i])][lane]) -
                       static_cast<double>(ray_.origin[axis_[i]]);
            };
            z[k] = away(2);
            x[k] = away(0) * forward - shear_x * z[k];
            y[k] = away(1) * forward - shear_y * z[k];
        }
        double weight[3], det = 0;
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 2) % 3, j = (k + 1) % 3;
            const double edge = x[i] * y[j] - y[i] * x[j];
            const double decided = negative ? -edge : edge;
            weight[k] = decided > 0 ? decided : 0;
            det += weight[k];
        }
        if (!(det > 0)) [[unlikely]] {  // edge-on but for the rounding of the vertices: their weights, then
            exact_edges(block, lane, weight);
            for (double& edge : weight) edge = std::abs(edge);
            det = weight[0] + weight[1] + weight[2];
        }
        const double inverse = 1.0 / det;
        hit.t = static_cast<float>((weight[0] * z[0] + weight[1] * z[1] + weight[2] * z[2]) / (det * forward));
        hit.u = static_cast<float>(weight[1] * inverse);
        hit.v = static_cast<float>(weight[2] * inverse);
        return true;
    }

    // The edge functions of the rounded corners; their signs are exact. Seldom called, so kept out of the loop.
    [[gnu::noinline]] void exact_edges(const TriangleBlock& block, int lane, double (&edges)[3]) const {
        double x[3], y[3];
        for (int k = 0; k < 3; ++k) {
            const auto away = [&](std::size_t i) { return block.rows[3 * k + static_cast<int>(axis_[i])][lane] - ray_.origin[axis_[i]]; };
            const float z = away(2);
            const float shifted_x = away(0) - shear_[0] * z, shifted_y = away(1) - shear_[1] * z;
            x[k] = shifted_x;
            y[k] = shifted_y;
        }
        for (int k = 0; k < 3; ++k) {
            const int i = (k + 2) % 3, j = (k + 1) % 3;
            edges[k] = x[i] * y[j] - y[i] * x[j];
        }
    }

    const RayFrame<Isa>& ray_;
    std::size_t axis_[3];  // the direction's longest axis last
    float shear_[2];
    Float4 origin_[3];
};

}  // namespace wive
