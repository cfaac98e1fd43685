"""Polygons to triangles: n - 2 of each, in the polygons' order.

A polygon that is star-shaped from its first corner, as every convex one, becomes a fan from there. Others
lose one ear at a time (Meisters 1975), all polygons of one size together. What isn't planar is seen along its
normal (Newell's). No corner is moved, merged or left out, so neighbours that share an edge still do.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.integer[Any]]
Floats = NDArray[np.float64]
# Corners looked at together: their coordinates stay in the cache.
BATCH = 1 << 15
# Ears of polygons larger than this take minutes: their number grows with the square of the corners.
MOST_CONCAVE_CORNERS = 20_000


def triangulate(vertices: NDArray[Any], sizes: Ints, corners: Ints, name: str) -> NDArray[np.int64]:
    """Triangles (f,3) of polygons: how many corners each has, at least three, and their vertices in a row.

    ValueError if a polygon that needs ears has too many corners; `name` is the file's.
    """
    corners = corners.astype(np.int64, copy=False)
    if not (sizes != 3).any():
        return np.reshape(corners, (-1, 3))
    first = np.cumsum(sizes) - sizes
    triangle = np.cumsum(sizes - 2) - (sizes - 2)
    out = np.empty((int((sizes - 2).sum()), 3), np.int64)
    for size in np.unique(sizes).tolist():
        fan = _fan(size)
        some = max(1, BATCH // size)
        same = np.flatnonzero(sizes == size)
        for which in (same[at : at + some] for at in range(0, len(same), some)):
            polygons = corners[first[which, None] + np.arange(size)]
            found = polygons[:, fan]
            if size > 3:
                _cut_ears(vertices, polygons, found, name)
            out[triangle[which, None] + np.arange(size - 2)] = found
    return out


def _fan(size: int) -> NDArray[np.int64]:
    """The corners (size - 2, 3) of a fan from the first corner."""
    second = np.arange(1, size - 1)
    return np.stack([np.zeros_like(second), second, second + 1], axis=1)


def _cut_ears(
    vertices: NDArray[Any], polygons: NDArray[np.int64], found: NDArray[np.int64], name: str
) -> None:
    """Replace the fans (m, n - 2, 3) that are no triangulation of their polygons (m,n)."""
    u, v = _seen(*(vertices[polygons, axis].astype(np.float64) for axis in range(3)))
    spoke_u, spoke_v = u[:, 1:] - u[:, :1], v[:, 1:] - v[:, :1]
    areas = spoke_u[:, :-1] * spoke_v[:, 1:] - spoke_v[:, :-1] * spoke_u[:, 1:]
    rest = np.flatnonzero(~(areas > 0).all(axis=1))
    # Polygons without area, or not finite, have no right triangles: a fan keeps their corners.
    rest = rest[np.isfinite(areas[rest]).all(axis=1) & areas[rest].any(axis=1)]
    if not rest.size:
        return
    size = polygons.shape[1]
    if size > MOST_CONCAVE_CORNERS:
        raise ValueError(
            f"{name}: a polygon of {size:,} corners is not convex, and concave ones may have "
            f"{MOST_CONCAVE_CORNERS:,}: triangulate the mesh before it is exported"
        )
    local = _ears(np.stack([u[rest], v[rest]], axis=2))
    found[rest] = np.take_along_axis(polygons[rest], local.reshape(len(rest), -1), axis=1).reshape(
        local.shape
    )


def _seen(x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats]:
    """Polygons (m,n) as seen along the axis nearest to their normals: counter-clockwise, from corner 0."""
    with np.errstate(all="ignore"):  # corners that aren't finite stay so
        sides = []
        for side in (x, y, z):
            side *= 0.25  # differences stay in range
            side -= side[:, :1].copy()
            sides.append(side)
        extent = np.maximum.reduce([np.abs(side).max(axis=1, keepdims=True) for side in sides])
        for side in sides:
            side /= np.maximum(extent, np.finfo(np.float64).tiny)
        after = [np.roll(side, -1, axis=1) for side in sides]
        normal = np.stack(
            [
                (sides[b] * after[c] - sides[c] * after[b]).sum(axis=1, keepdims=True)
                for b, c in ((1, 2), (2, 0), (0, 1))
            ]
        )
        axis = np.abs(normal).argmax(axis=0)
        backwards = np.take_along_axis(normal, axis[None], axis=0)[0] < 0
    u, v = np.choose((axis + 1) % 3, sides), np.choose((axis + 2) % 3, sides)
    return np.where(backwards, v, u), np.where(backwards, u, v)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _ears(flat: Floats) -> NDArray[np.int64]:
    """Ears (m, n - 2, 3) of simple polygons (m,n,2), counter-clockwise, in corner numbers."""
    count, size = flat.shape[:2]
    rows = np.arange(count)
    ring = np.tile(np.arange(size), (count, 1))
    ears = np.stack([_is_ear(flat, ring, np.full(count, corner)) for corner in range(size)], axis=1)
    out = np.empty((count, size - 2, 3), np.int64)
    for step in range(size - 3):
        length = size - step
        # A polygon that crosses itself may have no ear: its next corner is cut off as it is.
        at = ears.argmax(axis=1)
        before, after = (at - 1) % length, (at + 1) % length
        out[:, step] = np.stack([ring[rows, before], ring[rows, at], ring[rows, after]], axis=1)
        kept = np.ones((count, length), bool)
        kept[rows, at] = False
        ring, ears = ring[kept].reshape(count, -1), ears[kept].reshape(count, -1)
        # Only the two neighbours of an ear can become ears or cease to be.
        for moved in (before - (at < before), after - (at < after)):
            ears[rows, moved] = _is_ear(flat, ring, moved)
    out[:, -1] = ring
    return out


def _is_ear(flat: Floats, ring: NDArray[np.int64], at: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the triangle at each polygon's corner has area, and no other corner inside or on its edges."""
    rows, length = np.arange(len(ring)), ring.shape[1]
    a, b, c = (flat[rows, ring[rows, (at + step) % length]][:, None] for step in (-1, 0, 1))
    others = flat[rows[:, None], ring]
    inside = (
        (_cross(b - a, others - a) >= 0) & (_cross(c - b, others - b) >= 0) & (_cross(a - c, others - c) >= 0)
    )
    # The bridge to a hole passes its ends twice: what lies at a corner is not inside.
    for corner in (a, b, c):
        inside &= (others != corner).any(axis=2)
    return (_cross(b - a, c - a)[:, 0] > 0) & ~inside.any(axis=1)
