"""Closest hits of many rays decided in integers, against the few triangles that can be hit.

The candidates come from brute force in double with a margin far above its rounding; what lies within the
margin is decided in Python's integers (oracle.py), the rest is clear. For meshes of some hundred triangles.
"""

from fractions import Fraction

import numpy as np

from support.oracle import cross, dot, integers, unit_of

MARGIN = 1e-7  # of barycentrics, and of t relative to the mesh's size; double is wrong by less than 1e-10


def exact_prims(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """(n,) the lowest number of the triangles with the lowest t >= 0 of each ray, -1 if there is none."""
    ray, face = _candidates(vertices, faces, origins, directions)
    first = np.searchsorted(ray, np.arange(len(origins) + 1))
    prim = np.full(len(origins), -1, np.int32)
    height, determinant = _decide(vertices, faces, origins, directions, ray, face)
    for i in range(len(origins)):
        rows = range(first[i], first[i + 1])
        hits = [
            (Fraction(int(height[k]), int(determinant[k])), int(face[k]))
            for k in rows
            if determinant[k] is not None
        ]
        hits = [hit for hit in hits if hit[0] >= 0]
        if hits:
            prim[i] = min(hits)[1]
    return prim


def exact_distances(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray, prim: np.ndarray
) -> list[Fraction]:
    """t at which each ray meets the plane of its triangle, which it must hit."""
    pairs = _decide(vertices, faces, origins, directions, np.arange(len(prim)), prim)
    scale = Fraction(2) ** (unit_of(vertices, origins) - unit_of(directions))
    return [Fraction(int(h), int(d)) * scale for h, d in zip(*pairs, strict=True)]


def _candidates(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (ray, face), by ray, that may be the closest hit."""
    a, b, c = vertices[faces].astype(np.float64).swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    rays, found = [], []
    for start in range(0, len(origins), 20_000):
        o, d = (array[start : start + 20_000].astype(np.float64) for array in (origins, directions))
        steep = d @ normal.T
        with np.errstate(all="ignore"):
            t = ((a * normal).sum(axis=1) - o @ normal.T) / steep
            # The weights of b and c, as volumes: (d x (a - o)) . edge, by the triple product.
            moment = np.cross(o, d)
            u = -(moment @ (c - a).T + d @ np.cross(a, c - a).T) / steep
            v = (moment @ (b - a).T + d @ np.cross(a, b - a).T) / steep
        least = np.minimum(np.minimum(u, v), 1 - u - v)
        size = np.abs(t[np.isfinite(t) & (least > 0)]).max(initial=0)
        near = (least > -MARGIN) & (t > -MARGIN * size)
        certain = np.where((least > MARGIN) & (t > MARGIN * size), t, np.inf).min(axis=1, keepdims=True)
        near &= t <= certain + MARGIN * size
        ray, face = np.nonzero(near)
        rays.append(ray + start)
        found.append(face)
    return np.concatenate(rays), np.concatenate(found)


def _decide(
    vertices: np.ndarray,
    faces: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    ray: np.ndarray,
    face: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """height and determinant of each pair: t is their ratio, in a common unit; None if the line misses."""
    unit, direction_unit = unit_of(vertices, origins), unit_of(directions)
    o, d = integers(origins, unit)[ray], integers(directions, direction_unit)[ray]
    corners = integers(vertices, unit)[faces][face]
    a, b, c = (corners[:, k] - o for k in range(3))
    normal = cross(b - a, c - a)
    determinant = dot(d, normal)
    weights = np.stack([dot(d, cross(p, q)) for p, q in ((b, c), (c, a), (a, b))], axis=-1)
    turned = weights * np.where(determinant < 0, -1, 1)[:, None]
    inside = (determinant != 0) & (turned >= 0).all(axis=1)
    return dot(a, normal), np.where(inside, determinant, None)
