"""Origins from which a ray can't hit the triangle that it leaves: docs/accuracy.md, "Spawned rays".

The arithmetic is in cpu/core/spawn.inc and spawn_store.inc, which the core and the Warp kernels compile.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu
from wive._internal import arguments, mesh_arguments
from wive._internal.error_bounds import UNIT_ROUNDOFF
from wive._internal.host_arrays import host_arrays
from wive._internal.precision import Floats, real_of
from wive._internal.ray_shapes import flat_places
from wive._internal.shapes import Leading

FLOAT_ROUNDOFF = 2.0**-24
# The fast test: |a x b| with every term taken positive is at most 2/sqrt(3) |a||b|.
CROSSED = 1.1548

ACCURACIES = ("fast", "watertight", "exact")  # as SpawnOrigin numbers them


class Rounding(NamedTuple):
    """Rounding errors of the triangle tests and of spawning: members of SpawnOrigin, in its order."""

    # Errors of a point on a triangle and of its unit normal, both computed in double.
    point: float
    normal: float
    # The watertight test: rounding moves a corner, and its depth, by at most 7u of its distance along each
    # axis. Twice that covers neighbours in the same plane that extend twice as far.
    corner: float
    weights: float  # the watertight test's weights and their sum
    fast: float  # triple products in the fast test
    step: float  # how far a coordinate of an origin may be rounded, relative to the coordinate
    least: float  # added for subnormal numbers
    margin: float  # factor for second-order terms and the rounding of what is computed here


ROUNDINGS: Mapping[str, Rounding] = {
    "float32": Rounding(
        point=8 * UNIT_ROUNDOFF,
        normal=2.0**-48,
        corner=2 * 7 * FLOAT_ROUNDOFF,
        weights=2.0**-42,
        fast=CROSSED * FLOAT_ROUNDOFF,
        step=2 * FLOAT_ROUNDOFF,
        least=2.0**-120,
        margin=1.001,
    ),
    "float64": Rounding(
        point=8 * UNIT_ROUNDOFF,
        normal=2.0**-48,
        corner=2 * 7 * UNIT_ROUNDOFF,
        weights=2.0**-40,  # 903 * 2**-53 in a test that is all in double, and eight times that for neighbours
        fast=CROSSED * UNIT_ROUNDOFF,
        step=4 * UNIT_ROUNDOFF,
        least=2.0**-300,
        margin=1.001,
    ),
}


def spawn_origins(
    vertices: Floats,
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    uv: Floats,
    directions: Floats,
    accuracy: str,
) -> Floats:
    """(n,3) origins for directions (n,3) at uv (n,2) of triangles prim (n,); NaN if prim is negative.

    Their dtype is that of the vertices, so that of the scene they are for.
    """
    return _cpu.spawn_origins(
        vertices,
        faces,
        np.ascontiguousarray(prim),
        np.ascontiguousarray(uv),
        np.ascontiguousarray(directions),
        ACCURACIES.index(accuracy),
        ROUNDINGS[vertices.dtype.name],
    )


def spawn_from(
    vertices: Floats,
    faces: NDArray[np.int32],
    prim: ArrayLike,
    uv: ArrayLike,
    directions: ArrayLike,
    accuracy: str,
) -> Any:
    """`Scene.spawn`: the same from places of the user's, checked; in the library that they came in."""
    (prims, weights, along), library = host_arrays("spawn", prim=prim, uv=uv, directions=directions)
    prims, weights, along, leading = flat_places(prims, weights, along)
    triangles = mesh_arguments.triangles("prim", prims, len(faces))
    real, count = real_of(vertices.dtype, accuracy), len(triangles)
    rows = arguments.per_hit("uv", weights, 2, count, real)
    ways = arguments.per_hit("directions", along, 3, count, real)
    origins = library.from_numpy(spawn_origins(vertices, faces, triangles, rows, ways, accuracy))
    return origins if leading is None else Leading(library, leading)(origins)
