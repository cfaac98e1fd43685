"""Closest hits on a Warp device, with error bounds and spawned origins computed on the device.

The arithmetic is the text of cpu/core/error_bound.inc and spawn.inc, which the core compiles too: same bits.
"""

# mypy: disable-error-code="untyped-decorator, valid-type, no-redef"

import functools
from typing import Any

import warp as wp

from wive import _cpu
from wive._internal import error_bounds, spawn
from wive.warp_kernels.lanes.precision import PRECISIONS, in_double
from wive.warp_kernels.scene.surfaces import OPTIONS, vertices_of

BoundConstants = wp.types.vector(3, wp.float64)
SpawnConstants = wp.types.vector(len(spawn.Rounding._fields), wp.float64)


def bound_constants(precision: str) -> Any:
    """The constants of `bounds_kernel`."""
    return BoundConstants(*error_bounds.constants(precision))


def spawn_constants(precision: str) -> Any:
    """The constants of `spawn_kernel`."""
    return SpawnConstants(*spawn.ROUNDINGS[precision])


@wp.func_native(
    _cpu.surface_source
    + """
    const ErrorBound error = {constants[0], constants[1], constants[2]};
    return error.bound(corners.data, t, &origin[0], &direction[0]);
"""
)
def bound_of(
    corners: wp.mat33d, t: wp.float64, origin: wp.vec3d, direction: wp.vec3d, constants: BoundConstants
) -> wp.float64:
    """ErrorBound::bound of cpu/core/error_bound.inc; corners as rows."""
    ...


@wp.func_native(
    _cpu.surface_source
    + """
    const SpawnOrigin spawn = {accuracy, is_float, constants[0], constants[1], constants[2], constants[3],
                               constants[4], constants[5], constants[6], constants[7]};
    wp::vec_t<3, wp::float64> origin;
    SpawnStore::write(spawn, corners.data, u, v, &direction[0], &origin[0]);
    return origin;
"""
)
def origin_of(
    corners: wp.mat33d,
    u: wp.float64,
    v: wp.float64,
    direction: wp.vec3d,
    accuracy: int,
    is_float: bool,
    constants: SpawnConstants,
) -> wp.vec3d:
    """SpawnStore::write of cpu/core/spawn_store.inc; corners as rows."""
    ...


def _module(precision: str) -> Any:
    """The module in which kernels for scenes of that precision are compiled together."""
    module = wp.get_module(f"{__name__}.{precision}")
    wp.set_module_options(OPTIONS, module=module)
    return module


@functools.cache
def bounds_kernel(precision: str) -> Any:
    """The kernel behind `error_bound` for scenes of that precision."""
    real, vec3 = PRECISIONS[precision].real, PRECISIONS[precision].vec3

    @wp.kernel(module=_module(precision))
    def bound_errors(
        vertices: wp.array[vec3],
        faces: wp.array[wp.vec3i],
        prim: wp.array[wp.int32],
        distance: wp.array[real],
        origins: wp.array[vec3],
        directions: wp.array[vec3],
        constants: BoundConstants,
        bounds: wp.array[wp.float64],
    ) -> None:
        i = wp.tid()
        face = vertices_of(faces, prim[i], vertices.shape[0])
        if face[0] < 0:
            bounds[i] = wp.float64(wp.nan)
            return
        v0, v1, v2 = in_double(vertices[face[0]]), in_double(vertices[face[1]]), in_double(vertices[face[2]])
        origin, direction = in_double(origins[i]), in_double(directions[i])
        corners = wp.matrix_from_rows(v0, v1, v2)
        bounds[i] = bound_of(corners, wp.float64(distance[i]), origin, direction, constants)

    return bound_errors


@functools.cache
def spawn_kernel(precision: str) -> Any:
    """The kernel behind `spawn` for scenes of that precision."""
    numbers = PRECISIONS[precision]
    real, vec2, vec3 = numbers.real, numbers.vec2, numbers.vec3
    is_float = precision == "float32"

    @wp.kernel(module=_module(precision))
    def spawn_origins(
        vertices: wp.array[vec3],
        faces: wp.array[wp.vec3i],
        prim: wp.array[wp.int32],
        uv: wp.array[vec2],
        directions: wp.array[vec3],
        accuracy: int,
        constants: SpawnConstants,
        origins: wp.array[vec3],
    ) -> None:
        i = wp.tid()
        face = vertices_of(faces, prim[i], vertices.shape[0])
        if face[0] < 0:
            origins[i] = vec3(real(wp.nan))
            return
        v0, v1, v2 = in_double(vertices[face[0]]), in_double(vertices[face[1]]), in_double(vertices[face[2]])
        corners = wp.matrix_from_rows(v0, v1, v2)
        u, v = wp.float64(uv[i][0]), wp.float64(uv[i][1])
        origin = origin_of(corners, u, v, in_double(directions[i]), accuracy, wp.static(is_float), constants)
        origins[i] = vec3(real(origin[0]), real(origin[1]), real(origin[2]))

    return spawn_origins
