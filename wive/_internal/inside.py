"""Which points are inside a mesh: rays from there pass its surface an odd number of times.

In a closed mesh each edge is in two triangles, and crossings are counted. In a mesh whose faces are stored
twice, as two-sided exports are, each place has two crossings, and places are counted, whether both copies
have the same triangles or not. Two boxes that share a wall also have two triangles in one place; there,
crossings are counted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wive._internal.placed_mesh import Float64, Int64, PlacedMesh

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

Uint64 = NDArray[np.uint64]


def contains(placed: PlacedMesh, points: Float64, by_place: bool, threads: int | None) -> NDArray[np.bool_]:
    """(n,) bool: whether each point (n,3) is inside.

    `by_place`: whether each place of the surface counts once, however many triangles are there.
    """
    contained = np.zeros(len(points), np.bool_)
    low, high = placed.bounds
    (asked,) = np.nonzero(((points >= low) & (points <= high)).all(axis=1))
    passes = _places_passed if by_place else _crossings
    for direction in DIRECTIONS:
        there, sure_there = passes(placed, points[asked], direction, threads)
        back, sure_back = passes(placed, points[asked], -direction, threads)
        # A ray that meets nothing proves that the point is outside, whatever the other ray meets.
        free = (there == 0) | (back == 0)
        agreed = (there % 2 == back % 2) & sure_there & sure_back
        contained[asked] = (there % 2 == 1) & ~free
        asked = asked[~agreed & ~free]
        if len(asked) == 0:
            break
    return contained


def counts_by_place(placed: PlacedMesh, threads: int | None) -> bool:
    """Whether `contains` counts places: if faces are stored more than once, or the mesh has an open edge."""
    corners = _position_keys(placed.vertices)[placed.scene.faces]
    is_triangle = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    corners = corners[is_triangle]
    if len(corners) == 0:
        return False
    degrees = _edge_degrees(corners)
    if (degrees != 2).any():
        _, first = np.unique(_mixed(corners).sum(axis=1, dtype=np.uint64), return_index=True)
        if len(first) < len(corners) and (_edge_degrees(corners[first]) % 2 == 0).all():
            return True
    return bool((degrees % 2).any()) or _is_doubled_throughout(placed, threads)


def _crossings(
    placed: PlacedMesh, points: Float64, direction: Float64, threads: int | None
) -> tuple[Int64, NDArray[np.bool_]]:
    rays = placed.rays(points, np.broadcast_to(direction, points.shape))
    counts = placed.scene.count(*rays, threads=threads).astype(np.int64)
    return counts, np.ones(len(points), np.bool_)


def _places_passed(
    placed: PlacedMesh, points: Float64, direction: Float64, threads: int | None
) -> tuple[Int64, NDArray[np.bool_]]:
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
