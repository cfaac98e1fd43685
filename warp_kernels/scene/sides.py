"""Which side of its triangle a ray meets, at which angle, and values between vertices, on a Warp device.

The same arithmetic as `wive._internal.sides` and `wive._internal.interpolation`: same bits.
"""

# mypy: disable-error-code="untyped-decorator, valid-type, empty-body"

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from wive._internal.sides import LEAST, SURE
from wive.warp_kernels.lanes.precision import PRECISIONS, in_double
from wive.warp_kernels.scene.surfaces import OPTIONS, vertices_of


@wp.func_native("""
    // The sum of the 18 products of three in the determinant, as doubles that don't overlap: Shewchuk 1997,
    // Grow-Expansion. Products are split by Dekker's method: no fused multiply-add is needed.
    struct Exact {
        double parts[72];
        int count;
        static void sum(double a, double b, double& whole, double& rest) {
            whole = a + b;
            const double from_b = whole - a;
            rest = (a - (whole - from_b)) + (b - from_b);
        }
        static double high(double x) {
            const double c = 134217729.0 * x;
            return c - (c - x);
        }
        static void product(double a, double b, double& whole, double& rest) {
            whole = a * b;
            const double ah = high(a), al = a - ah, bh = high(b), bl = b - bh;
            rest = al * bl - (((whole - ah * bh) - al * bh) - ah * bl);
        }
        void add(double value) {
            for (int i = 0; i < count; ++i) {
                double whole, rest;
                sum(value, parts[i], whole, rest);
                parts[i] = rest;
                value = whole;
            }
            parts[count++] = value;
        }
        void add_product(double a, double b, double c) {
            double whole, rest;
            product(a, b, whole, rest);
            const double two[2] = {rest, whole};
            for (int i = 0; i < 2; ++i) {
                product(two[i], c, whole, rest);
                add(rest);
                add(whole);
            }
        }
    };
    double largest = 0;
    for (int i = 0; i < 3; ++i) {
        const double size = direction[i] < 0 ? -direction[i] : direction[i];
        if (!(size <= 1.7976931348623157e308)) return false;
        if (size > largest) largest = size;
    }
    if (largest == 0) return false;
    double scale = 1;
    while (largest * scale >= 1) scale *= 0.5;
    while (largest * scale < 0.5) scale *= 2;
    const double* corner = corners.data[0];
    double against = 0, size = 0;
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        const double d = direction[i] * scale;
        const double plus = (corner[3 + j] - corner[j]) * (corner[6 + k] - corner[k]);
        const double minus = (corner[3 + k] - corner[k]) * (corner[6 + j] - corner[j]);
        against += d * (plus - minus);
        size += (d < 0 ? -d : d) * ((plus < 0 ? -plus : plus) + (minus < 0 ? -minus : minus));
    }
    if ((against < 0 ? -against : against) > sure * size && size > least) return against < 0;
    Exact exact;
    exact.count = 0;
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        const double d = direction[i] * scale;
        for (int p = 0; p < 3; ++p) {
            const int q = (p + 1) % 3;
            exact.add_product(corner[3 * p + j], corner[3 * q + k], d);
            exact.add_product(-corner[3 * p + k], corner[3 * q + j], d);
        }
    }
    for (int i = exact.count - 1; i >= 0; --i)
        if (exact.parts[i] != 0) return exact.parts[i] < 0;
    return false;
""")
def is_front(corners: wp.mat33d, direction: wp.vec3d, sure: wp.float64, least: wp.float64) -> wp.bool:
    """Whether normal . direction < 0, exactly unless products are below 1e-290; corners as rows."""
    ...


@functools.cache
def side_kernels(precision: str) -> SimpleNamespace:
    """The kernels for scenes of that precision, compiled together."""
    numbers = PRECISIONS[precision]
    vec2, vec3 = numbers.vec2, numbers.vec3
    module = wp.get_module(f"{__name__}.{precision}")
    wp.set_module_options(OPTIONS, module=module)

    @wp.kernel(module=module)
    def front(
        vertices: wp.array[vec3],
        faces: wp.array[wp.vec3i],
        prim: wp.array[wp.int32],
        directions: wp.array[vec3],
        front: wp.array[wp.bool],
    ) -> None:
        i = wp.tid()
        face = vertices_of(faces, prim[i], vertices.shape[0])
        front[i] = False
        if face[0] >= 0:
            v0, v1 = in_double(vertices[face[0]]), in_double(vertices[face[1]])
            corners = wp.matrix_from_rows(v0, v1, in_double(vertices[face[2]]))
            front[i] = is_front(
                corners, in_double(directions[i]), wp.static(wp.float64(SURE)), wp.static(wp.float64(LEAST))
            )

    @wp.kernel(module=module)
    def cosines(
        normals: wp.array[wp.vec3d], directions: wp.array[vec3], cosines: wp.array[wp.float64]
    ) -> None:
        i = wp.tid()
        d = in_double(directions[i])
        d = scaled(d)
        n = normals[i]
        along = wp.abs(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
        cosine = along / wp.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        if cosine > wp.float64(1.0):
            cosine = wp.float64(1.0)
        cosines[i] = cosine

    @wp.kernel(module=module)
    def interpolate(
        values: wp.array2d[Any],
        faces: wp.array[wp.vec3i],
        prim: wp.array[wp.int32],
        uv: wp.array[vec2],
        answer: wp.array2d[Any],
    ) -> None:
        i, k = wp.tid()
        face = vertices_of(faces, prim[i], values.shape[0])
        if face[0] < 0:
            answer[i, k] = answer.dtype(wp.nan)
            return
        u, v = wp.float64(uv[i][0]), wp.float64(uv[i][1])
        w = wp.float64(1.0) - u - v
        a, b = wp.float64(values[face[0], k]), wp.float64(values[face[1], k])
        answer[i, k] = answer.dtype(w * a + u * b + v * wp.float64(values[face[2], k]))

    for number in (wp.float32, wp.float64):
        wp.overload(interpolate, {"values": wp.array2d[number], "answer": wp.array2d[number]})
    return SimpleNamespace(front=front, cosines=cosines, interpolate=interpolate)


@wp.func_native("""
    double largest = 0;
    for (int i = 0; i < 3; ++i) {
        const double size = direction[i] < 0 ? -direction[i] : direction[i];
        if (size > largest) largest = size;
    }
    double scale = 1;
    if (largest > 0 && largest <= 1.7976931348623157e308) {
        while (largest * scale >= 1) scale *= 0.5;
        while (largest * scale < 0.5) scale *= 2;
    }
    return direction * scale;
""")
def scaled(direction: wp.vec3d) -> wp.vec3d:
    """The direction times a power of two, so that no product over- or underflows."""
    ...
