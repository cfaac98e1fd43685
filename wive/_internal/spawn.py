"""Origins from which a ray can't hit the triangle that it leaves: docs/accuracy.md, "Spawned rays"."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.error_bounds import UNIT_ROUNDOFF, Float64, blocks_of_hits, corner_rows, cross, dot
from wive._internal.precision import Floats

FLOAT_ROUNDOFF = 2.0**-24
# Where a triangle's point is, and where its normal points, as computed here in double.
POINT_ERROR = 8 * 2.0**-53
NORMAL_ERROR = 2.0**-48
# The watertight test: rounding moves a corner, and its depth, by at most 7u of its distance along each axis.
# Twice that covers neighbours in the same plane that reach twice as far.
CORNER_ERROR = 2 * 7 * FLOAT_ROUNDOFF
WEIGHTS_ERROR = 2.0**-42
# The same of a test that is all in double: 903 * 2**-53, and eight times that for neighbours.
DOUBLE_WEIGHTS_ERROR = 2.0**-40
# The fast test: |a x b| with every term taken positive is at most 2/sqrt(3) |a||b|.
CROSSED = 1.1548
FAST_ERROR = CROSSED * FLOAT_ROUNDOFF
# For second-order terms and the rounding of what is computed here; and for subnormal numbers.
MARGIN, LEAST = 1.001, 2.0**-120
DOUBLE_LEAST = 2.0**-300


class Rounding(NamedTuple):
    """What rounding does in the triangle tests of a precision, and to an origin's coordinates."""

    corner: float
    weights: float
    fast: float
    step: float  # how far a coordinate may be rounded, relative to it
    least: float


ROUNDINGS: Mapping[str, Rounding] = {
    "float32": Rounding(CORNER_ERROR, WEIGHTS_ERROR, FAST_ERROR, 2 * FLOAT_ROUNDOFF, LEAST),
    "float64": Rounding(
        2 * 7 * UNIT_ROUNDOFF, DOUBLE_WEIGHTS_ERROR, CROSSED * UNIT_ROUNDOFF, 4 * UNIT_ROUNDOFF, DOUBLE_LEAST
    ),
}


class Surface(NamedTuple):
    """Triangles hit, (h,) each, and the unit normals (3,h) on the side to leave by."""

    normal: Float64
    area: Float64  # twice the area: |first x second|
    first: Float64  # lengths of the edges from corner 0
    second: Float64
    reach: Float64  # the largest coordinate of a corner relative to the point
    from_first: Float64  # from corner 0 to the point
    step: Float64  # how far a coordinate is rounded, at most
    rounding: Rounding


def spawn_origins(
    vertices: Floats,
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    uv: Floats,
    directions: Floats,
    accuracy: str,
) -> Floats:
    """(n,3) origins for directions (n,3) at uv (n,2) of triangles prim (n,); NaN where prim is negative.

    In the dtype of the vertices, which is that of the scene they are for.
    """
    origins = np.full((len(prim), 3), np.nan, vertices.dtype)
    rounding = ROUNDINGS[vertices.dtype.name]
    for rows in blocks_of_hits(prim):
        corners = corner_rows(vertices, faces, prim[rows])
        u, v = uv[rows].astype(np.float64).T
        direction = directions[rows].astype(np.float64).T
        with np.errstate(all="ignore"):  # an infinite direction; a triangle whose area underflows
            origins[rows] = _origins(corners, u, v, direction, CLEARANCES[accuracy], rounding).T
    return origins


def _origins(
    corners: Float64, u: Float64, v: Float64, direction: Float64, clearance: "Clearance", rounding: Rounding
) -> Floats:
    v0, v1, v2 = corners
    first, second = v1 - v0, v2 - v0
    normal = cross(first, second)
    area = np.sqrt(dot(normal, normal))
    _, exponent = np.frexp(abs(direction).max(axis=0))  # directions of any length neither over- nor underflow
    normal *= np.where(dot(normal, np.ldexp(direction, -exponent)) < 0, -1.0, 1.0)
    normal /= area
    point = (1 - u - v) * v0 + u * v1 + v * v2
    largest = abs(corners).max(axis=0)
    surface = Surface(
        normal=normal,
        area=area,
        first=np.sqrt(dot(first, first)),
        second=np.sqrt(dot(second, second)),
        reach=abs(corners - point).max(axis=(0, 1)),
        from_first=np.sqrt(dot(point - v0, point - v0)),
        step=rounding.step * largest.max(axis=0) + rounding.least,
        rounding=rounding,
    )
    unsure = POINT_ERROR * dot(abs(normal), largest)
    # A move takes the origin away from the corners, too: a second round allows for twice the first.
    offset = _offset(surface, clearance, unsure, surface.step)
    offset = _offset(surface, clearance, unsure, surface.step + 2 * offset)
    # Only needles ask for more than their size; nothing is promised for those.
    offset = np.minimum(offset, surface.reach + surface.step)
    origin = point + offset * normal
    return _round_towards(normal, origin) if rounding is ROUNDINGS["float32"] else _step_on(normal, origin)


def _offset(surface: Surface, clearance: "Clearance", unsure: Float64, moved: Float64) -> Float64:
    """(h,) how far to move points for origins to clear the triangle, no coordinate moving by over `moved`."""
    moved = MARGIN * moved
    lean = NORMAL_ERROR * surface.first * surface.second / surface.area
    needed = np.maximum(clearance(surface, moved), lean * (surface.reach + moved))
    offset: Float64 = MARGIN * (needed + unsure + lean * surface.step) + surface.rounding.least
    return offset


def _round_towards(normal: Float64, point: Float64) -> NDArray[np.float32]:
    """Each coordinate rounded to float where the normal points, so that no rounding leads back."""
    rounded = point.astype(np.float32)
    back = (rounded - point) * normal < 0
    away = np.where(normal < 0, -np.inf, np.inf).astype(np.float32)
    return np.where(back, np.nextafter(rounded, away), rounded)


def _step_on(normal: Float64, point: Float64) -> Float64:
    """Each coordinate's next double where the normal points: no less than adding up has rounded away."""
    away = np.where(normal < 0, -np.inf, np.inf)
    return np.where(normal == 0, point, np.nextafter(point, away))


# How far from the plane, (h,), an origin must be for an accuracy's triangle test, if no coordinate of it is
# farther than `moved` (h,) from the point's.
Clearance = Callable[[Surface, Float64], Float64]


def _fast(surface: Surface, moved: Float64) -> Float64:
    longest = np.maximum(surface.first, surface.second)
    lengths = 21 * (surface.from_first + 2 * moved) + 14 * longest
    needed: Float64 = surface.rounding.fast * surface.first * surface.second / surface.area * lengths
    return needed


def _watertight(surface: Surface, moved: Float64) -> Float64:
    reach = surface.reach + moved
    x, y, z = abs(surface.normal)
    corners = surface.rounding.corner * reach * (x + y + z)
    needed: Float64 = np.maximum(corners, surface.rounding.weights * reach * reach * reach / surface.area)
    return needed


def _exact(surface: Surface, moved: Float64) -> Float64:
    return np.zeros_like(moved)


CLEARANCES: Mapping[str, Clearance] = {"fast": _fast, "watertight": _watertight, "exact": _exact}
