"""Polygons to triangles: n - 2 of each, in the polygons' order.

A polygon that is star-shaped from its first corner, as every convex one, becomes a fan from there. If it is
so from its second corner, the fan begins there; no quad needs more. The rest lose one ear at a time. What
isn't planar is seen along its normal (Newell's). No corner is moved, merged or left out, so neighbours that
share an edge still do.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.ears import Tangled, ears

Ints = NDArray[np.int64]
Integer = TypeVar("Integer", np.int32, np.int64)
Floats = NDArray[np.float64]
# Corners looked at together: their coordinates stay in the cache.
BATCH = 1 << 15


def triangulate(vertices: NDArray[Any], sizes: Ints, corners: Ints, name: str) -> Ints:
    """Triangles (f,3) of polygons: how many corners each has, at least three, and their vertices in a row.

    ValueError if a polygon is too tangled; `name` is the file's.
    """
    if not (sizes != 3).any():
        return np.reshape(corners, (-1, 3))
    first = np.cumsum(sizes) - sizes
    triangle = np.cumsum(sizes - 2) - (sizes - 2)
    out = np.empty((int((sizes - 2).sum()), 3), np.int64)
    order = np.argsort(sizes, kind="stable")
    for same in np.split(order, np.flatnonzero(np.diff(sizes[order])) + 1):
        size = int(sizes[same[0]])
        some = max(1, BATCH // size)
        for which in (same[at : at + some] for at in range(0, len(same), some)):
            polygons = corners[first[which, None] + np.arange(size)]
            found = polygons[:, fan(np.arange(size))]
            if size > 3:
                try:
                    _mend(vertices, polygons, found)
                except Tangled as tangled:
                    raise ValueError(f"{name}: {tangled}") from None
            out[triangle[which, None] + np.arange(size - 2)] = found
    return out


def strip(corners: NDArray[Integer]) -> NDArray[Integer]:
    """Triangles (n - 2, 3) of a strip of n corners, of which every other one winds the other way."""
    found = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    found[1::2] = found[1::2][:, [0, 2, 1]]
    return found


def fan(corners: NDArray[Integer]) -> NDArray[Integer]:
    """Triangles (n - 2, 3) of a fan of n corners, each from the first one."""
    return np.stack([np.broadcast_to(corners[:1], len(corners) - 2), corners[1:-1], corners[2:]], axis=1)


def _mend(vertices: NDArray[Any], polygons: Ints, found: Ints) -> None:
    """Replace the fans (m, n - 2, 3) that are no triangulation of their polygons (m,n)."""
    size = polygons.shape[1]
    flat = _seen(*(vertices[polygons, axis].astype(np.float64) for axis in range(3)))
    areas = _fan_areas(flat)
    rest = np.flatnonzero(~(areas > 0).all(axis=1))
    # Polygons without area, or not finite, have no right triangles: a fan keeps their corners.
    rest = rest[np.isfinite(areas[rest]).all(axis=1) & areas[rest].any(axis=1)]
    if rest.size:
        # A quad has no third way: it takes the better one.
        least = areas[rest].min(axis=1) if size == 4 else 0
        is_fan = _fan_areas(np.roll(flat[:, rest], -1, axis=2)).min(axis=1) > least
        found[rest[is_fan]] = polygons[rest[is_fan]][:, fan(np.roll(np.arange(size), -1))]
        for row in rest[~is_fan].tolist() if size > 4 else ():
            found[row] = polygons[row][ears(*flat[:, row].tolist())]


def _fan_areas(flat: Floats) -> Floats:
    """Twice the area of each triangle of fans from the first corner, negative if it is turned over."""
    u, v = flat[:, :, 1:] - flat[:, :, :1]
    areas: Floats = u[:, :-1] * v[:, 1:] - v[:, :-1] * u[:, 1:]
    return areas


def _seen(*sides: Floats) -> Floats:
    """Polygons (m,n) as seen along the axis nearest to their normals, counter-clockwise: (2,m,n)."""
    with np.errstate(all="ignore"):  # corners that aren't finite stay so
        for side in sides:
            side *= 0.25  # differences stay in range
            side -= side[:, :1].copy()
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
    return np.stack([np.where(backwards, v, u), np.where(backwards, u, v)])
