"""Closest hits on a Warp device: the error of t, and origins for spawned rays, computed there.

Operation by operation as wive/error_bounds.py and wive/spawn.py, where the reasons are: same bits.
"""

# mypy: disable-error-code="untyped-decorator, valid-type, no-redef"

import functools
from typing import Any

import warp as wp

from wive._internal import error_bounds, spawn
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.frame import powers_of
from wive.warp_kernels.scene.surfaces import OPTIONS, in_double

ERROR = wp.constant(wp.float64(error_bounds.ROUNDINGS * error_bounds.UNIT_ROUNDOFF))
ROUND_UP = wp.constant(wp.float64(1 + 8 * error_bounds.UNIT_ROUNDOFF))
POINT_ERROR = wp.constant(wp.float64(spawn.POINT_ERROR))
NORMAL_ERROR = wp.constant(wp.float64(spawn.NORMAL_ERROR))
MARGIN = wp.constant(wp.float64(spawn.MARGIN))

ACCURACIES = tuple(spawn.CLEARANCES)
FAST, WATERTIGHT = (wp.constant(ACCURACIES.index(name)) for name in ("fast", "watertight"))


def _module(precision: str) -> Any:
    """Where kernels for scenes of that precision are compiled together."""
    module = wp.get_module(f"{__name__}.{precision}")
    wp.set_module_options(OPTIONS, module=module)
    return module


@wp.func
def _dot(a: wp.vec3d, b: wp.vec3d) -> wp.float64:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@wp.func
def _cross(a: wp.vec3d, b: wp.vec3d) -> wp.vec3d:
    return wp.vec3d(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@wp.func
def _abs(a: wp.vec3d) -> wp.vec3d:
    return wp.vec3d(wp.abs(a[0]), wp.abs(a[1]), wp.abs(a[2]))


@wp.func
def _crossed_sizes(a: wp.vec3d, b: wp.vec3d) -> wp.vec3d:
    return wp.vec3d(
        wp.abs(a[1]) * wp.abs(b[2]) + wp.abs(a[2]) * wp.abs(b[1]),
        wp.abs(a[2]) * wp.abs(b[0]) + wp.abs(a[0]) * wp.abs(b[2]),
        wp.abs(a[0]) * wp.abs(b[1]) + wp.abs(a[1]) * wp.abs(b[0]),
    )


@wp.func
def _sum(a: wp.vec3d) -> wp.float64:
    return a[0] + a[1] + a[2]


@functools.cache
def bounds_kernel(precision: str) -> Any:
    """The kernel behind `error_bound` for scenes of that precision."""
    real, vec3 = PRECISIONS[precision].real, PRECISIONS[precision].vec3
    underflow = wp.float64(error_bounds.UNDERFLOW if precision == "float64" else 0.0)

    @wp.kernel(module=_module(precision))
    def bound_errors(
        vertices: wp.array[vec3],
        faces: wp.array[wp.vec3i],
        prim: wp.array[wp.int32],
        distance: wp.array[real],
        origins: wp.array[vec3],
        directions: wp.array[vec3],
        bounds: wp.array[wp.float64],
    ) -> None:
        i = wp.tid()
        if prim[i] < 0:
            bounds[i] = wp.float64(wp.nan)
            return
        face = faces[prim[i]]
        v0 = in_double(vertices[face[0]])
        first = in_double(vertices[face[1]]) - v0
        second = in_double(vertices[face[2]]) - v0
        away = v0 - in_double(origins[i])
        direction = in_double(directions[i])
        t = wp.float64(distance[i])
        normal = _cross(first, second)
        size = _crossed_sizes(first, second)
        height = _dot(normal, away)
        slope = _dot(normal, direction)
        height_error = ERROR * _dot(size, _abs(away))
        slope_error = ERROR * _dot(size, _abs(direction))
        if wp.static(underflow != 0.0):
            height_error = height_error + underflow * (wp.float64(1.0) + _sum(_abs(away)))
            slope_error = slope_error + underflow * (wp.float64(1.0) + _sum(_abs(direction)))
        if wp.abs(slope) > slope_error and wp.isfinite(t):
            residual = wp.abs(t * slope - height) + (height_error + wp.abs(t) * slope_error)
            bounds[i] = residual / (wp.abs(slope) - slope_error) * ROUND_UP + underflow
        else:
            bounds[i] = wp.float64(wp.inf)

    return bound_errors


@wp.struct
class _Surface:
    """As `wive._internal.spawn.Surface`."""

    normal: wp.vec3d
    area: wp.float64
    first: wp.float64
    second: wp.float64
    reach: wp.float64
    from_first: wp.float64
    step: wp.float64
    unsure: wp.float64


@wp.func
def _round_towards(normal: wp.float64, x: wp.float64) -> wp.float32:
    rounded = wp.float32(x)
    if (wp.float64(rounded) - x) * normal < wp.float64(0.0):
        bits = wp.cast(rounded, wp.int32)
        if rounded == wp.float32(0.0):
            smallest = wp.cast(1, wp.float32)
            return wp.where(normal < wp.float64(0.0), -smallest, smallest)
        grow = (rounded < wp.float32(0.0)) == (normal < wp.float64(0.0))
        return wp.cast(wp.where(grow, bits + 1, bits - 1), wp.float32)
    return rounded


@wp.func
def _step_on(normal: wp.float64, x: wp.float64) -> wp.float64:
    if normal == wp.float64(0.0):
        return x
    bits = wp.cast(x, wp.int64)
    if x == wp.float64(0.0):
        smallest = wp.cast(wp.int64(1), wp.float64)
        return wp.where(normal < wp.float64(0.0), -smallest, smallest)
    grow = (x < wp.float64(0.0)) == (normal < wp.float64(0.0))
    return wp.cast(wp.where(grow, bits + wp.int64(1), bits - wp.int64(1)), wp.float64)


@wp.func
def _largest(a: wp.vec3d) -> wp.float64:
    return wp.max(wp.max(wp.abs(a[0]), wp.abs(a[1])), wp.abs(a[2]))


@functools.cache
def spawn_kernel(precision: str) -> Any:
    """The kernel behind `spawn` for scenes of that precision."""
    numbers, rounding = PRECISIONS[precision], spawn.ROUNDINGS[precision]
    real, vec2, vec3 = numbers.real, numbers.vec2, numbers.vec3
    corner_error, weights_error, fast_error, step_size, least = map(wp.float64, rounding)
    leave = _round_towards if precision == "float32" else _step_on

    @wp.func
    def clearance(surface: _Surface, moved: wp.float64, accuracy: int) -> wp.float64:
        if accuracy == FAST:
            longest = wp.max(surface.first, surface.second)
            lengths = wp.float64(21.0) * (surface.from_first + wp.float64(2.0) * moved)
            lengths = lengths + wp.float64(14.0) * longest
            return fast_error * surface.first * surface.second / surface.area * lengths
        if accuracy == WATERTIGHT:
            reach = surface.reach + moved
            n = _abs(surface.normal)
            corners = corner_error * reach * (n[0] + n[1] + n[2])
            return wp.max(corners, weights_error * reach * reach * reach / surface.area)
        return wp.float64(0.0)

    @wp.func
    def offset_of(surface: _Surface, given: wp.float64, accuracy: int) -> wp.float64:
        moved = MARGIN * given
        lean = NORMAL_ERROR * surface.first * surface.second / surface.area
        needed = wp.max(clearance(surface, moved, accuracy), lean * (surface.reach + moved))
        return MARGIN * (needed + surface.unsure + lean * surface.step) + least

    @wp.kernel(module=_module(precision))
    def spawn_origins(
        vertices: wp.array[vec3],
        faces: wp.array[wp.vec3i],
        prim: wp.array[wp.int32],
        uv: wp.array[vec2],
        directions: wp.array[vec3],
        accuracy: int,
        origins: wp.array[vec3],
    ) -> None:
        i = wp.tid()
        if prim[i] < 0:
            origins[i] = vec3(real(wp.nan))
            return
        face = faces[prim[i]]
        v0 = in_double(vertices[face[0]])
        v1 = in_double(vertices[face[1]])
        v2 = in_double(vertices[face[2]])
        first = v1 - v0
        second = v2 - v0
        normal = _cross(first, second)
        area = wp.sqrt(_dot(normal, normal))
        direction = in_double(directions[i])
        # Its longest component brought to [1/2, 1): no product overflows.
        direction = direction * (powers_of(_largest(direction))[0] * wp.float64(0.5))
        if _dot(normal, direction) < wp.float64(0.0):
            normal = -normal
        normal = wp.vec3d(normal[0] / area, normal[1] / area, normal[2] / area)
        u = wp.float64(uv[i][0])
        v = wp.float64(uv[i][1])
        w = wp.float64(1.0) - u - v
        point = w * v0 + u * v1 + v * v2

        surface = _Surface()
        surface.normal = normal
        surface.area = area
        surface.first = wp.sqrt(_dot(first, first))
        surface.second = wp.sqrt(_dot(second, second))
        surface.reach = wp.max(wp.max(_largest(v0 - point), _largest(v1 - point)), _largest(v2 - point))
        surface.from_first = wp.sqrt(_dot(point - v0, point - v0))
        largest = wp.max(wp.max(_abs(v0), _abs(v1)), _abs(v2))
        surface.step = step_size * _largest(largest) + least
        surface.unsure = POINT_ERROR * _dot(_abs(normal), largest)
        offset = offset_of(surface, surface.step, accuracy)
        offset = offset_of(surface, surface.step + wp.float64(2.0) * offset, accuracy)
        offset = wp.min(offset, surface.reach + surface.step)
        at = point + offset * normal
        origins[i] = vec3(
            leave(normal[0], at[0]),
            leave(normal[1], at[1]),
            leave(normal[2], at[2]),
        )

    return spawn_origins
