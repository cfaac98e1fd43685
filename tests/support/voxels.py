"""Closed surfaces of random unit cells, and rays that meet their vertices, edges and faces."""

import numpy as np

from support.hard_sets import few_bits

SIDE = 4


def voxels(seed: int, share: float = 0.4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The surface of random unit cells, two triangles per square, and the (4,4,4) cells that are filled."""
    filled = np.random.default_rng(seed).random((SIDE, SIDE, SIDE)) < share
    padded = np.pad(filled, 1)
    points: dict[tuple[int, ...], int] = {}
    faces = []
    for axis in range(3):
        ahead, across, up = np.eye(3, dtype=int)[[axis, (axis + 1) % 3, (axis + 2) % 3]]
        for cell in np.argwhere(padded != np.roll(padded, -1, axis)):
            corner = cell - 1 + ahead
            square = [corner, corner + across, corner + across + up, corner + up]
            a, b, c, d = (points.setdefault(tuple(map(int, p)), len(points)) for p in square)
            faces += [[a, b, c], [a, c, d]] if padded[tuple(cell)] else [[a, c, b], [a, d, c]]
    return np.array(list(points), np.float32), np.array(faces, np.int32), filled


def surface_rays(vertices: np.ndarray, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from places of quarter coordinates off the integer planes, along axes and at vertices."""
    random = np.random.default_rng(seed)
    origins = random.integers(-1, SIDE + 1, (count, 3)) + 0.25 * random.integers(1, 4, (count, 3))
    aims = vertices[random.integers(len(vertices), size=count)] - origins
    lattice = few_bits(random, count, 2)
    directions = np.where(random.random((count, 1)) < 0.5, aims, lattice).astype(np.float32)
    moving = (directions != 0).any(axis=1)
    return origins[moving].astype(np.float32), directions[moving]
