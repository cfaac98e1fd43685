"""Which points are inside a mesh: rays from there pass its surface an odd number of times.

In a closed mesh each edge is in an even number of triangles, crossings are counted, and any ray decides. Of
other meshes a ray and its opposite have to agree. In a mesh whose faces are stored twice, as two-sided
exports are, each place has two crossings, and `wive.trimesh` counts places, whether both copies have the same
triangles or not. Two boxes that share a wall also have two triangles in one place; there, crossings are
counted.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.precision import Floats
from wive._internal.progress import part

if TYPE_CHECKING:
    from wive._internal.placed_mesh import PlacedMesh

# Directions of rays, tried until a ray and its opposite agree; the first is trimesh's.
DIRECTIONS = np.array(
    [
        (0.4395064455, 0.617598629942, 0.652231566745),
        (-0.7312847092, 0.2291845177, 0.6424302511),
        (0.1739403627, -0.8852167384, 0.4314573921),
        (0.3021745963, 0.1583490127, -0.9400123871),
        (-0.5530281746, -0.5871930264, -0.5910274385),
    ]
)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
# Triangles of which one ray each shows whether the whole mesh is stored twice.
SAMPLES = 64
# The sine between planes that are one plane.
ONE_PLANE = 1e-6

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Uint64 = NDArray[np.uint64]
Mask = NDArray[np.bool_]
# For points and a direction, or one each: how many crossings or places rays pass, and whether that is sure.
Passes = Callable[[Any, Float64], tuple[NDArray[Any], Mask | None]]


class Closedness(NamedTuple):
    """What is known of a mesh from its edges."""

    closed: bool  # every edge is in an even number of triangles: the number of crossings decides
    by_place: bool  # faces are stored more than once, or there is an open edge: places count


def contains(bounds: NDArray[Any], points: NDArray[Any], passes: Passes, closed: bool) -> Mask:
    """(n,) bool: whether each point (n,3) is inside; `closed`: one ray decides."""
    contained = np.zeros(len(points), np.bool_)
    low, high = bounds
    within = points[:, 0] >= low[0]
    for axis in range(3):
        within &= (points[:, axis] >= low[axis]) & (points[:, axis] <= high[axis])
    (asked,) = np.nonzero(within)
    if len(asked) == 0:
        return contained
    if closed:
        some = points if len(asked) == len(points) else points[asked]
        contained[asked] = passes(some, _shortest_ways(some, low, high))[0] & 1
        return contained
    for i, direction in enumerate(DIRECTIONS):
        # Of those that remain, half of the time goes to the ray and most of the rest to its opposite.
        with part(1 - 0.25**i, 1 - 0.5 * 0.25**i):
            there, sure_there = passes(points[asked], direction)
        odd = there % 2 == 1
        contained[asked] = odd
        # A ray that meets nothing proves that the point is outside, whatever the other ray meets.
        (met,) = np.nonzero(there != 0)
        with part(1 - 0.5 * 0.25**i, 1 - 0.25 ** (i + 1)):
            back, sure_back = passes(points[asked[met]], -direction)
        free, agreed = back == 0, odd[met] == (back % 2 == 1)
        for sure in (None if sure_there is None else sure_there[met], sure_back):
            if sure is not None:
                agreed &= sure
        contained[asked[met[free]]] = False
        asked = asked[met[~agreed & ~free]]
        if len(asked) == 0:
            break
    return contained


def _shortest_ways(points: NDArray[Any], low: NDArray[Any], high: NDArray[Any]) -> NDArray[Any]:
    """(n,3) directions out of the box along its shortest side, to the nearer end: past fewer triangles."""
    axis = int(np.argmin(high - low))
    ways = np.zeros_like(points)
    ways[:, axis] = np.where(points[:, axis] > low[axis] + (high[axis] - low[axis]) / 2, 1, -1)
    return ways


def is_closed(vertices: Floats, faces: NDArray[np.int32]) -> bool:
    """Whether every edge is in an even number of triangles, by the positions of vertices."""
    corners = _position_keys(vertices.astype(np.float64, copy=False))[faces]
    is_triangle = (corners != np.roll(corners, 1, axis=1)).all()
    return bool(is_triangle and (_edge_degrees(corners) % 2 == 0).all())


def closedness(placed: PlacedMesh, threads: int | None) -> Closedness:
    """What the edges say of a mesh of trimesh."""
    corners = _position_keys(placed.vertices)[placed.scene.faces]
    is_triangle = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    whole, corners = bool(is_triangle.all()), corners[is_triangle]
    if len(corners) == 0:
        return Closedness(closed=False, by_place=False)
    degrees = _edge_degrees(corners)
    if (degrees != 2).any():
        _, first = np.unique(_mixed(corners).sum(axis=1, dtype=np.uint64), return_index=True)
        if len(first) < len(corners) and (_edge_degrees(corners[first]) % 2 == 0).all():
            return Closedness(closed=False, by_place=True)
    odd = bool((degrees % 2).any())
    by_place = odd or _is_doubled_throughout(placed, threads)
    return Closedness(whole and not by_place and placed.scene.accuracy != "fast", by_place)


def passes_of(placed: PlacedMesh, by_place: bool, threads: int | None) -> Passes:
    """How often rays pass a mesh of trimesh; `by_place`: places, however many triangles are there."""

    def crossings(points: Float64, direction: Float64) -> tuple[NDArray[Any], Mask | None]:
        rays = placed.rays(points, np.broadcast_to(direction, points.shape))
        return placed.scene.count(*rays, threads=threads), None

    def places(points: Float64, direction: Float64) -> tuple[NDArray[Any], Mask | None]:
        return _places_passed(placed, points, direction, threads)

    return places if by_place else crossings


def _places_passed(
    placed: PlacedMesh, points: Float64, direction: Float64, threads: int | None
) -> tuple[Int64, Mask]:
    """How many places each ray passes, and whether that is sure: at an edge it passes several planes."""
    directions = np.tile(direction, (len(points), 1))
    found, again = placed.every_hit(points, directions, threads)
    is_first = np.ones(len(found.ray), np.bool_) if again is None else ~again
    (first,) = np.nonzero(is_first)
    normals = _unit_normals(placed, found.prim)
    tilted = np.cross(normals, normals[first[np.cumsum(is_first) - 1]])
    unsure = found.ray[np.linalg.norm(tilted, axis=1) > ONE_PLANE]
    sure = np.ones(len(points), np.bool_)
    sure[unsure] = False
    return np.bincount(found.ray[first], minlength=len(points)), sure


def _is_doubled_throughout(placed: PlacedMesh, threads: int | None) -> bool:
    """Whether each place that a few rays pass holds an even number of triangles: faces are stored twice."""
    faces = placed.scene.faces
    rows = faces[np.linspace(0, len(faces) - 1, min(SAMPLES, len(faces)), dtype=np.intp)]
    directions = np.tile(DIRECTIONS[0], (len(rows), 1))
    origins = placed.vertices[rows].mean(axis=1) - 2 * np.sqrt(3) * placed.size * directions
    _, again = placed.every_hit(origins, directions, threads)
    if again is None:
        return False
    counts = np.bincount(np.cumsum(~again))[1:]
    return bool((counts % 2 == 0).all())


def _unit_normals(placed: PlacedMesh, prim: NDArray[np.int32]) -> Float64:
    v0, v1, v2 = placed.vertices[placed.scene.faces[prim]].swapaxes(0, 1)
    sides = np.stack([v1 - v0, v2 - v0])
    sides /= np.abs(sides).max(axis=2, keepdims=True)  # so that no square of a length is too small or large
    normals = np.cross(*sides)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals


def _edge_degrees(corners: Uint64) -> Int64:
    """In how many triangles each edge is, by the keys (f,3) of their corners' positions."""
    keys = _mixed(corners)
    return np.asarray(np.unique(keys + np.roll(keys, 1, axis=1), return_counts=True)[1], np.int64)


def _position_keys(vertices: Float64) -> Uint64:
    """(v,) one number per position; the same for vertices in the same place."""
    bits = (vertices + 0.0).view(np.uint64)  # -0.0 becomes 0.0
    keys = np.zeros(len(vertices), np.uint64)
    for axis in range(3):
        keys = _mixed(keys ^ bits[:, axis])
    return keys


def _mixed(keys: Uint64) -> Uint64:
    """Keys whose sums tell sets of keys apart: Steele, Lea and Flood 2014, SplitMix64."""
    keys = keys + np.uint64(0x9E3779B97F4A7C15)
    keys = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    keys = (keys ^ (keys >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return keys ^ (keys >> np.uint64(31))
