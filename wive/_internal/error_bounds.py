"""How far t can be from the exact distance, judged in double: docs/accuracy.md, "The error of t"."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from wive._internal.precision import Floats

Float64 = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-53  # of double
# A term of the residual is rounded at most nine times; three more are for the bound's own rounding.
ROUNDINGS = 12
# What products of doubles lose below the smallest normal one, all together; those of float32 lose nothing.
UNDERFLOW = 2.0**-1070
BLOCK_ROWS = 1 << 15  # rows taken at once: what they need in between stays in cache


def t_error_bounds(
    vertices: Floats,
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    t: Floats,
    origins: Floats,
    directions: Floats,
) -> Float64:
    """(n,) bounds on the distance of t (n,) from where rays meet the planes of triangles prim (n,).

    NaN where prim is negative. Vertices and rays are float32, or all float64.
    """
    bounds = np.full(len(prim), np.nan)
    underflow = UNDERFLOW if vertices.dtype == np.float64 else 0.0
    for rows in blocks_of_hits(prim):
        corners = corner_rows(vertices, faces, prim[rows])
        origin, direction = (array[rows].astype(np.float64).T for array in (origins, directions))
        with np.errstate(all="ignore"):
            bounds[rows] = _bounds(corners, t[rows].astype(np.float64), origin, direction, underflow)
    return bounds


def _bounds(corners: Float64, t: Float64, origin: Float64, direction: Float64, underflow: float) -> Float64:
    """Of corners (3,3,h), t (h,), origin and direction (3,h)."""
    v0, v1, v2 = corners
    first, second, away = v1 - v0, v2 - v0, v0 - origin
    normal, size = cross(first, second), crossed_sizes(first, second)
    height, slope = dot(normal, away), dot(normal, direction)
    height_error = ROUNDINGS * UNIT_ROUNDOFF * dot(size, abs(away))
    slope_error = ROUNDINGS * UNIT_ROUNDOFF * dot(size, abs(direction))
    if underflow:
        height_error += underflow * (1 + abs(away).sum(axis=0))
        slope_error += underflow * (1 + abs(direction).sum(axis=0))
    residual = abs(t * slope - height) + (height_error + abs(t) * slope_error)
    bounds = residual / (abs(slope) - slope_error) * (1 + 8 * UNIT_ROUNDOFF) + underflow
    return np.where((abs(slope) > slope_error) & np.isfinite(t), bounds, np.inf)


def blocks_of_hits(prim: NDArray[np.int32]) -> Iterator[NDArray[np.intp]]:
    """Row numbers of the hits among `prim`, a block at a time."""
    (hits,) = np.nonzero(prim >= 0)
    for first in range(0, len(hits), BLOCK_ROWS):
        yield hits[first : first + BLOCK_ROWS]


def corner_rows(vertices: Floats, faces: NDArray[np.int32], prim: NDArray[np.int32]) -> Float64:
    """(3,3,h): corner by corner, then axis by axis, of triangles prim (h,)."""
    return vertices[faces[prim]].astype(np.float64).transpose(1, 2, 0)


# One operation after another in the order that wive/warp_spawn.py has, too: the bits are the same.


def dot(a: Float64, b: Float64) -> Float64:
    """(h,) of (3,h) each."""
    product: Float64 = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


def cross(a: Float64, b: Float64) -> Float64:
    """(3,h) of (3,h) each."""
    return np.stack([a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)])


def crossed_sizes(a: Float64, b: Float64) -> Float64:
    """(3,h): the cross product with every term taken positive, which bounds its rounding."""
    a, b = abs(a), abs(b)
    return np.stack([a[i - 2] * b[i - 1] + a[i - 1] * b[i - 2] for i in range(3)])
