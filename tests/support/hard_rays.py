"""Meshes and rays whose hits depend on rounding."""

import numpy as np

from support.meshes import sphere

Mesh = tuple[np.ndarray, np.ndarray]


def hard_rays(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    """Rays at vertices, edges and face centres from inside and outside, axis rays, invalid rays.

    They have the vertices' dtype.
    """
    center = (vertices.min(axis=0).astype(np.float64) + vertices.max(axis=0)) / 2
    corners = vertices[faces].astype(np.float64)
    aims = np.concatenate([vertices, corners[:, :2].mean(axis=1), corners.mean(axis=1)])
    random = np.random.default_rng(7)
    aims = aims[random.permutation(len(aims))[:400]]
    size = np.ptp(vertices, axis=0).max()
    starts = center + np.where(np.arange(len(aims)) % 2, 0.0, 1.7)[:, None] * size * random.standard_normal(3)
    axis_directions = np.stack(np.meshgrid(*[[-1.0, -0.0, 0.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    axis_starts = np.concatenate([np.repeat(center[None], 64, axis=0), np.resize(vertices, (64, 3))])
    odd_origins = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 2e18]])
    odd_directions = np.array([[1, 0, 0], [1, 0, 0], [np.nan, 1, 0], [1, -np.inf, 0], [0, 0, 0], [0, 0, -1]])
    tiny = np.array([[1e-42, 0, 0], [1e38, 1e-38, 0], [3e38, 3e38, 3e38], [1.0, 1e-30, -1e-40]])
    origins = np.concatenate([starts, axis_starts, odd_origins, np.repeat(center[None], 4, axis=0)])
    directions = np.concatenate([aims - starts, axis_directions, axis_directions, odd_directions, tiny])
    with np.errstate(over="ignore"):
        return origins.astype(vertices.dtype), directions.astype(vertices.dtype)


HARD_MESHES = {
    "sphere": lambda: sphere(3),
    "sphere far away": lambda: (sphere(3)[0] + np.float32([148376, 1234, -223423]), sphere(3)[1]),
    "tiny sphere": lambda: sphere(2, 1e-6),
    "huge sphere": lambda: sphere(2, 1e6),
    "integer grid": lambda: grid(8),
    "one triangle": lambda: (np.float32([[0, 0, 1], [1, 0, 1], [0, 1, 1]]), np.int32([[0, 1, 2]])),
    "coincident": lambda: (sphere(1)[0], np.repeat(sphere(1)[1], 5, axis=0)),
    "degenerate": lambda: (sphere(1)[0], np.ascontiguousarray(sphere(1)[1][:, [0, 1, 1]])),
    "empty": lambda: (np.zeros((3, 3), np.float32), np.zeros((0, 3), np.int32)),
}


def grid(side: int) -> Mesh:
    """A flat square of unit cells with corners at integers."""
    x, y = np.meshgrid(np.arange(side + 1), np.arange(side + 1), indexing="ij")
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(np.float32)
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    faces = np.concatenate(
        [np.stack([a, a + side + 1, a + 1], 1), np.stack([a + 1, a + side + 1, a + side + 2], 1)]
    )
    return vertices, faces.astype(np.int32)
