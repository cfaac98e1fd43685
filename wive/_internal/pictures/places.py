"""Places on a scene's surfaces, by which views are compared."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.pictures.shades import dots
from wive._internal.pictures.surroundings import Sight
from wive.camera import Camera
from wive.hits import surface_normals, surface_points

Float64 = NDArray[np.float64]

# Of larger scenes some triangles at even steps, at least so many.
MOST_TRIANGLES = 1 << 19
SURFACE_SAMPLES = 1024
# The cosine between an axis and the normal of a surface that lies across it.
LEVEL = 0.95


class Places(NamedTuple):
    """Points on the surface with their normals, and origins just off their front sides.

    Even rows are picked by area, odd ones by triangle: walls and floors have the area, what stands in a room
    has the triangles.
    """

    points: Float64
    normals: Float64
    origins: Float64
    level: Float64  # (3,) the share of all area whose normal is near each axis

    def first(self, count: int) -> Places:
        """The first ones."""
        return Places(self.points[:count], self.normals[:count], self.origins[:count], self.level)


def surface_places(sight: Sight) -> Places | None:
    """Places on triangles picked at random, half of them in proportion to area; None if none has any."""
    scene, random = sight.scene, np.random.default_rng(0)
    step = max(1, len(scene) // MOST_TRIANGLES)
    faces = scene.faces[::step]
    a, b, c = (scene.vertices[faces[:, k]].astype(np.float64) for k in range(3))
    with np.errstate(over="ignore", invalid="ignore"):
        crossed = crosses(b - a, c - a)
        area = np.sqrt(dots(crossed, crossed))
    (real,) = np.nonzero(np.isfinite(area) & (area > 0))
    if len(real) == 0:
        return None
    area, crossed = area[real] / area[real].max(), crossed[real] / area[real].max()
    level = ((abs(crossed) > LEVEL * area[:, None]) * area[:, None]).sum(axis=0) / area.sum()
    half = SURFACE_SAMPLES // 2
    rows = np.empty(2 * half, np.intp)
    until = np.cumsum(area)
    rows[::2] = real[np.searchsorted(until[:-1], random.random(half) * until[-1])]
    rows[1::2] = real[random.integers(0, len(real), half)]
    prim = (step * rows).astype(np.int32)
    uv = random.random((len(prim), 2))
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv).astype(scene.vertices.dtype)
    normals = surface_normals(scene.vertices, scene.faces, prim)
    origins = scene.spawn(prim, uv, normals)
    points = surface_points(scene.vertices, scene.faces, prim, uv)
    return Places(points, normals, origins.astype(np.float64), level)


def crosses(a: Float64, b: Float64) -> Float64:
    """(n,3) products of rows, in a third of the time of np.cross."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def seen_from(sight: Sight, eyes: Float64, places: Places) -> NDArray[np.bool_]:
    """(e,p), whether the front side of each place is seen from each eye."""
    views = eyes[:, None] - places.points
    in_front: NDArray[np.bool_] = (views * places.normals).sum(axis=2) > 0
    eye, place = np.nonzero(in_front)
    real = sight.scene.vertices.dtype
    origins = places.origins[place].astype(real)
    ways = (eyes[eye] - places.origins[place]).astype(real)
    in_front[eye, place] = ~sight.occluded(origins, ways, tmax=1.0)
    return in_front


def in_view(camera: Camera, points: Float64, aspect: float) -> NDArray[np.bool_]:
    """(n,), whether a picture of this aspect holds each point."""
    eye, forward, right, top = camera.frame(round(1024 * aspect) or 1, 1024).astype(np.float64)
    views = points - eye
    depth = dots(views, np.broadcast_to(forward, views.shape))
    x = dots(views, np.broadcast_to(right, views.shape)) / dots(right[None], right[None])
    y = dots(views, np.broadcast_to(top, views.shape)) / dots(top[None], top[None])
    return np.asarray((depth > 0) & (abs(x) <= depth) & (abs(y) <= depth))


def share_of(seen: NDArray[np.bool_]) -> Float64:
    """(...,) the share of the places seen (...,p): the geometric mean of those by area and by triangle."""
    areas, triangles = seen[..., ::2].mean(axis=-1), seen[..., 1::2].mean(axis=-1)
    return np.asarray(np.sqrt(areas * triangles))
