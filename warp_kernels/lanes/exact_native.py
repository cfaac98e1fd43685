"""Native code of the exact triangle test: the filter of triangle_exact.h, and the core's own integers.

The C++ text of the integers is `_cpu.exact_source`, the same that the core is compiled from.
"""

import warp as wp

from wive import _cpu

# Triangles are passed as the words at which their vertices begin, axes `stride` words apart.

# One triangle against the ray's line in double, as cpu/traverse/triangle_exact.h. The error is derived in
# docs/accuracy.md; fused multiply-adds only make it smaller.
_FILTER = """
    struct Filter {
        double weight[3], z[3], low, high, depth_near, depth_far, along, error;

        Filter(const float* tree, wp::vec_t<3, int> at, int stride, wp::vec_t<3, int> axes,
               wp::vec_t<3, float> origin, double shear_x, double shear_y) {
            double x[3], y[3];
            for (int k = 0; k < 3; ++k) {
                const float* corner = tree + at[k];
                z[k] = (double)corner[stride * axes[2]] - (double)origin[axes[2]];
                x[k] = ((double)corner[stride * axes[0]] - (double)origin[axes[0]]) - shear_x * z[k];
                y[k] = ((double)corner[stride * axes[1]] - (double)origin[axes[1]]) - shear_y * z[k];
            }
            double aside = 0.0;
            for (int k = 0; k < 3; ++k) {
                const int i = (k + 1) % 3, j = (k + 2) % 3;
                weight[k] = x[i] * y[j] - y[i] * x[j];
                const double ax = x[k] < 0.0 ? -x[k] : x[k], ay = y[k] < 0.0 ? -y[k] : y[k];
                aside = ax > aside ? ax : aside;
                aside = ay > aside ? ay : aside;
            }
            low = lower(lower(weight[0], weight[1]), weight[2]);
            high = -lower(lower(-weight[0], -weight[1]), -weight[2]);
            depth_near = lower(lower(z[0], z[1]), z[2]);
            depth_far = -lower(lower(-z[0], -z[1]), -z[2]);
            along = -lower(depth_near, -depth_far);
            const double e = 1.1102230246251565e-16;  // 2^-53
            error = (aside + 4.0 * e * along) * (13.0 * e * aside + 21.0 * e * along);
        }
        static double lower(double a, double b) { return a < b ? a : b; }
    };
"""

# NaN, which unused lanes of a float32 block hold, passes no comparison.
_MAY_HIT = (
    _FILTER
    + """
    const Filter filter((const float*)units, at, stride, axes, origin, shear_x, shear_y);
    return -filter.error <= filter.low || filter.high <= filter.error;
"""
)

_SETUP = (
    _cpu.exact_source
    + """
    const float from[3] = {origin[0], origin[1], origin[2]};
    const float way[3] = {direction[0], direction[1], direction[2]};
    float corners[9];
    for (int i = 0; i < 9; ++i) corners[i] = ((const float*)units)[at[i / 3] + stride * (i % 3)];
"""
)

# t, u, v and 1; on a miss the last is 0.
_SOLVE = (
    _FILTER
    + """
    const Filter filter((const float*)units, at, stride, axes, origin, shear_x, shear_y);
    const double e = 1.1102230246251565e-16;
    const bool on_edge = filter.low <= filter.error && -filter.error <= filter.high;  // maybe
    bool doubt = on_edge;
    const double share = 1.0 / (filter.weight[0] + filter.weight[1] + filter.weight[2]);
    const double weight_error = 6.0 * filter.error * (share < 0.0 ? -share : share);
    double depth = 0.0;
    for (int k = 0; k < 3; ++k) depth += filter.weight[k] * filter.z[k];
    depth *= share;
    const double extent = filter.depth_far - filter.depth_near;
    const double depth_error = weight_error * extent + 12.0 * e * filter.along;
    const double values[3] = {depth * inverse, filter.weight[1] * share, filter.weight[2] * share};
    const double errors[3] = {depth_error * (inverse < 0.0 ? -inverse : inverse), weight_error, weight_error};
    wp::vec_t<4, float> hit;
    for (int i = 0; i < 3; ++i) {
        const float below = (float)(values[i] - errors[i]), above = (float)(values[i] + errors[i]);
        doubt = doubt || !(below == above);
        hit[i] = below + 0.0f;
        // Most doubts are about hits on the surface that a ray leaves from, outside its limits.
        if (i == 0 && !on_edge && (above < tmin || below > farthest_t)) {
            hit[3] = 0.0f;
            return hit;
        }
        doubt = doubt || (i == 0 && below == 0.0f);  // the sign of zero matters
    }
    hit[3] = 1.0f;
    if (!doubt) {
        hit[3] = hit[0] >= tmin && hit[0] <= farthest_t ? 1.0f : 0.0f;
        return hit;
    }
"""
    + _SETUP
    + """
    hit[3] = 0.0f;
    // In a plane across an axis on which the direction is zero: edge-on, as in a floor that the ray lies in.
    for (int i = 0; i < 3; ++i)
        if (way[i] == 0.0f && corners[i] == corners[3 + i] && corners[i] == corners[6 + i]) return hit;
    const int unit = ExactIntersection::unit_of(corners, 9, ExactIntersection::unit_of(from, 3));
    const ExactIntersection exact(from, way, corners, unit);
    if (!(crossings ? exact.hit_perturbed : exact.hit)) return hit;
    const float t = exact.t();
    // -0 is that of a hit behind the origin.
    const bool behind = t == 0.0f && BigInt::bits_of(t) != 0u && tmin == 0.0f;
    if (!(t >= tmin && t <= farthest_t) || behind) return hit;
    hit[0] = t + 0.0f;  // no -0
    hit[1] = exact.u();
    hit[2] = exact.v();
    hit[3] = 1.0f;
    return hit;
"""
)

_COMPARE = (
    _SETUP
    + """
    float others[9];
    for (int i = 0; i < 9; ++i) others[i] = ((const float*)units)[other[i / 3] + other_stride * (i % 3)];
    int unit = ExactIntersection::unit_of(corners, 9, ExactIntersection::unit_of(from, 3));
    unit = ExactIntersection::unit_of(others, 9, unit);
    if (ExactIntersection::are_same(corners, others)) return 0;
    return ExactIntersection(from, way, corners, unit).compare(ExactIntersection(from, way, others, unit));
"""
)


@wp.func_native(_MAY_HIT)
def may_hit(
    units: wp.uint64,
    at: wp.vec3i,
    stride: int,
    axes: wp.vec3i,
    origin: wp.vec3,
    shear_x: wp.float64,
    shear_y: wp.float64,
) -> bool:
    """Whether the ray's line may hit a triangle: false only if it certainly misses."""
    ...


@wp.func_native(_SOLVE)
def solve_exactly(
    units: wp.uint64,
    at: wp.vec3i,
    stride: int,
    axes: wp.vec3i,
    origin: wp.vec3,
    direction: wp.vec3,
    shear_x: wp.float64,
    shear_y: wp.float64,
    inverse: wp.float64,
    tmin: float,
    farthest_t: float,
    crossings: bool,
) -> wp.vec4:
    """t, u and v of a triangle, correctly rounded, and 1; the last is 0 if the line misses the triangle.

    It is 0 also if t, so rounded, is outside [tmin, farthest_t]. crossings: a line through an edge or vertex
    hits triangles there as if its origin were moved by an infinitely small amount.
    """
    ...


@wp.func_native(_COMPARE)
def compare_distances(
    units: wp.uint64,
    at: wp.vec3i,
    stride: int,
    other: wp.vec3i,
    other_stride: int,
    origin: wp.vec3,
    direction: wp.vec3,
) -> int:
    """The sign of the difference of two triangles' t."""
    ...
