"""Which segments are free, decided by rational arithmetic against every triangle."""

from fractions import Fraction

import numpy as np

from support.error_bounds import fractions
from support.oracle import cross, dot

POINT_ROUNDINGS = 4  # docs/accuracy.md, "Line of sight"
UTM = np.array([743512.37, 4042318.81, 812.5])


def error_of(*dtypes: type) -> Fraction:
    """How far coordinates of a point on a surface may be off, relative to them, in the coarsest type."""
    return POINT_ROUNDINGS * Fraction(max(float(np.finfo(dtype).eps) for dtype in dtypes)) / 2


def free(
    vertices: np.ndarray, faces: np.ndarray, a: np.ndarray, b: np.ndarray, error: Fraction
) -> np.ndarray:
    """(n,) bool: whether a segment meets no triangle that separates its ends by more than `error`."""
    first, second = fractions(a), fractions(b)
    blocked = [blocks(corners, first, second, error) for corners in fractions(vertices[faces])]
    return ~np.any(blocked, axis=0)


def blocks(corners: np.ndarray, a: np.ndarray, b: np.ndarray, error: Fraction) -> np.ndarray:
    """(n,) bool: whether segments meet the closed triangle and it separates their ends a and b (n,3)."""
    v0, v1, v2 = corners
    normal = cross(v1 - v0, v2 - v0)
    largest = abs(corners).max(axis=0)
    heights = [dot(normal, end - v0) for end in (a, b)]
    off = [
        abs(h) > error * dot(abs(normal), np.maximum(largest, abs(end)))
        for h, end in zip(heights, (a, b), strict=True)
    ]
    separated = (heights[0] * heights[1] < 0) & off[0] & off[1]
    weights = np.stack([dot(b - a, cross(p - a, q - a)) for p, q in ((v1, v2), (v2, v0), (v0, v1))])
    return separated & ((weights >= 0).all(axis=0) | (weights <= 0).all(axis=0))


def places(corners: np.ndarray, dtype: type, seed: int) -> dict[str, np.ndarray]:
    """Points (n,3) on triangles (n,3,3), in the ways that users compute them."""
    random = np.random.default_rng(seed)
    rounded = corners.astype(dtype)
    weights = random.dirichlet(np.ones(3), len(corners))
    u, v = weights[:, 1:].T.astype(dtype)[..., None]
    root, other = np.sqrt(random.random((2, len(corners), 1)).astype(dtype))
    v0, v1, v2 = rounded.swapaxes(0, 1)
    one = dtype(1)
    return {
        "sampled in double": np.einsum("nk,nkx->nx", weights, corners).astype(dtype),
        "sampled": (one - u - v) * v0 + u * v1 + v * v2,
        "sampled by a root": (one - root) * v0 + root * (one - other) * v1 + root * other * v2,
        "centres": rounded.mean(axis=1),
        "corners": rounded[np.arange(len(corners)), random.integers(3, size=len(corners))],
        "middles of edges": (v0 + v1) / dtype(2),
        "near an edge": (rounded[:, 0] + rounded[:, 1]) / dtype(2) + dtype(1e-6) * (v2 - v0),
    }


def wall(dtype: type, place: np.ndarray, scale: float, normal: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A square wall of 8 x 8 cells, each two triangles, across an axis, around a place."""
    steps = np.arange(9) / 4 - 1
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.insert(grid, normal, 0, axis=1)
    corner = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    a, b, c, d = corner, corner + 9, corner + 10, corner + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return (points * scale + place).astype(dtype), faces.astype(np.int32)
