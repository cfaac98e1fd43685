"""Polygons to triangles: n - 2 of each, in the polygons' order.

A polygon that is star-shaped from its first corner, as every convex one, becomes a fan from there. Others lose one ear
at a time (Meisters 1975), all polygons of one size together. What isn't planar is seen along its normal (Newell's).
Every corner is kept: none is moved, merged or left out, so neighbours that share an edge still do.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.integer[Any]]
# Ears of polygons larger than this take minutes: their number grows with the square of the corners.
MOST_CONCAVE_CORNERS = 20_000


def triangulate(vertices: NDArray[Any], sizes: Ints, corners: Ints, name: str) -> NDArray[np.int64]:
    """Triangles (f,3) of polygons: how many corners each has, at least three, and their vertices in a row.

    ValueError if a polygon that needs ears has too many corners; `name` is the file's.
    """
    corners = np.asarray(corners, dtype=np.int64)
    if not (sizes != 3).any():
        return corners.reshape(-1, 3)
    first = np.cumsum(sizes) - sizes
    triangle = np.cumsum(sizes - 2) - (sizes - 2)
    out = np.empty((int((sizes - 2).sum()), 3), np.int64)
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        polygons = corners[first[which, None] + np.arange(size)]
        local = _fans(len(which), int(size)) if size == 3 else _local(vertices, polygons, name)
        found = np.take_along_axis(polygons, local.reshape(len(which), -1), axis=1)
        out[triangle[which, None] + np.arange(size - 2)] = found.reshape(len(which), -1, 3)
    return out


def _fans(count: int, size: int) -> NDArray[np.int64]:
    """Fans from the first corner, (count, size - 2, 3), in corner numbers."""
    second = np.arange(1, size - 1)
    fan = np.stack([np.zeros_like(second), second, second + 1], axis=1)
    return np.broadcast_to(fan, (count, size - 2, 3))


def _local(vertices: NDArray[Any], polygons: NDArray[np.int64], name: str) -> NDArray[np.int64]:
    """Triangles (m, n - 2, 3) of polygons (m, n), in corner numbers."""
    count, size = polygons.shape
    flat = _flattened(vertices[polygons])
    spokes = flat[:, 1:] - flat[:, :1]
    is_fan = (_cross(spokes[:, :-1], spokes[:, 1:]) > 0).all(axis=1)
    local = _fans(count, size)
    # Polygons without area, or not finite, have no right triangles: a fan keeps their corners.
    rest = np.flatnonzero(
        ~is_fan & np.isfinite(flat).all(axis=(1, 2)) & (np.ptp(flat, axis=1) > 0).all(axis=1)
    )
    if not rest.size:
        return local
    if size > MOST_CONCAVE_CORNERS:
        raise ValueError(
            f"{name}: a polygon of {size:,} corners is not convex, and concave ones may have "
            f"{MOST_CONCAVE_CORNERS:,}: triangulate the mesh before it is exported"
        )
    local = local.copy()
    local[rest] = _ears(flat[rest])
    return local


def _flattened(points: NDArray[Any]) -> NDArray[np.float64]:
    """Polygons (m,n,3) seen along the axis nearest to their normals, (m,n,2), counter-clockwise."""
    with np.errstate(all="ignore"):  # corners that aren't finite stay so
        points = points.astype(np.float64) * 0.25  # differences stay in range
        points -= points[:, :1].copy()
        points /= np.maximum(np.abs(points).max(axis=(1, 2), keepdims=True), np.finfo(np.float64).tiny)
        normal = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
        axis = np.abs(normal).argmax(axis=1)
        backwards = np.take_along_axis(normal, axis[:, None], axis=1) < 0
    seen = np.stack([(axis + 1) % 3, (axis + 2) % 3], axis=1)
    seen = np.where(backwards, seen[:, ::-1], seen)
    return np.take_along_axis(points, seen[:, None, :], axis=2)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _ears(flat: NDArray[np.float64]) -> NDArray[np.int64]:
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


def _is_ear(flat: NDArray[np.float64], ring: NDArray[np.int64], at: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether the triangle at each polygon's corner has area and contains no other corner, not even on its edges."""
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
