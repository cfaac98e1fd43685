"""Which side of its triangle a ray meets, and at which angle."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from wive._internal.error_bounds import UNIT_ROUNDOFF
from wive._internal.interpolation import BLOCK, corners_of
from wive._internal.precision import Floats

Float64 = NDArray[np.float64]

# normal . direction in double is wrong by less than this times the same sum with every term taken positive: a
# product of three is rounded five times, differences of corners included, and the sum of six terms thrice.
SURE = 16 * UNIT_ROUNDOFF
# Below this, what products lose as subnormal numbers counts.
LEAST = 2.0**-960


def meets_front(
    vertices: Floats, faces: NDArray[np.int32], prim: NDArray[np.int32], directions: Floats
) -> NDArray[np.bool_]:
    """(n,) whether normal . direction < 0 at triangles prim (n,), exactly; False if prim is no face."""
    front = np.zeros(len(prim), np.bool_)
    for first in range(0, len(prim), BLOCK):
        block = slice(first, first + BLOCK)
        hit, corners = corners_of(faces, prim[block], len(vertices))
        triangles = vertices[corners].astype(np.float64)
        direction = directions[block][hit].astype(np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            against, size = _against_normal(triangles, _scaled(direction))
            sure = (abs(against) > SURE * size) & (size > LEAST) & np.isfinite(size)
        inside = against < 0
        for row in np.nonzero(~sure)[0]:
            inside[row] = _is_front_exactly(triangles[row], direction[row])
        front[block][hit] = inside
    return front


def cosines_of(normals: Float64, directions: Floats) -> Float64:
    """(n,) |normal . direction| / |direction| of unit normals (n,3)."""
    cosines = np.empty(len(normals))
    for first in range(0, len(normals), BLOCK):
        block = slice(first, first + BLOCK)
        n = normals[block].T
        with np.errstate(all="ignore"):
            x, y, z = _scaled(directions[block].astype(np.float64)).T
            along = abs(n[0] * x + n[1] * y + n[2] * z)
            cosines[block] = np.minimum(along / np.sqrt(x * x + y * y + z * z), 1.0)
    return cosines


def _scaled(directions: Float64) -> Float64:
    """The directions times powers of two, so that no product over- or underflows."""
    x, y, z = abs(directions).T
    _, exponents = np.frexp(np.maximum(np.maximum(x, y), z))
    return np.asarray(np.ldexp(directions, -exponents[:, None]))


def _against_normal(triangles: Float64, directions: Float64) -> tuple[Float64, Float64]:
    """(n,) normal . direction, and the sum of its terms taken positive."""
    one, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    against, size = np.zeros(len(directions)), np.zeros(len(directions))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        plus, minus = one[:, j] * other[:, k], one[:, k] * other[:, j]
        against += directions[:, i] * (plus - minus)
        size += abs(directions[:, i]) * (abs(plus) + abs(minus))
    return against, size


def _is_front_exactly(triangle: Float64, direction: Float64) -> bool:
    if not np.isfinite(direction).all():
        return False
    a, b, c = ([Fraction(number) for number in corner] for corner in triangle.tolist())
    d = [Fraction(number) for number in direction.tolist()]
    one, other = ([x - y for x, y in zip(corner, a, strict=True)] for corner in (b, c))
    terms = (d[i] * (one[j] * other[k] - one[k] * other[j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
    return bool(sum(terms) < 0)
