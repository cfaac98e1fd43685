"""Closed meshes at any place and scale, rays that leave them at vertices and edges, and a terrain in UTM."""

import functools

import numpy as np

from support.meshes import sphere

Mesh = tuple[np.ndarray, np.ndarray]

SCALES = [1e-6, 1e-3, 1.0, 1e3, 1e6]
COMPONENTS = (-1.0, -0.0, 0.0, 1.0)
DIRECTIONS = np.array(
    [(x, y, z) for x in COMPONENTS for y in COMPONENTS for z in COMPONENTS if (x, y, z) != (0, 0, 0)],
    np.float32,
)


def grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed box [0, size]^3 whose six sides are integer grids of two triangles per cell."""
    vertices, faces = _grid(size)
    return vertices.copy(), faces.copy()


@functools.cache
def _grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    corners: dict[tuple[int, int, int], int] = {}
    faces: list[list[int]] = []

    def corner(point: np.ndarray) -> int:
        return corners.setdefault(tuple(int(x) for x in point), len(corners))

    for axis in range(3):
        u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
        for side in (0, size):
            base = side * np.eye(3, dtype=int)[axis]
            for i in range(size):
                for j in range(size):
                    a, b, c, d = (
                        corner(base + x * u + y * v)
                        for x, y in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
                    )
                    faces += [[a, b, c], [a, c, d]] if side else [[a, c, b], [a, d, c]]
    return np.array(list(corners), np.float32), np.array(faces, np.int32)


TETRAHEDRON = (
    np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float32),
    np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32),
)
SHAPES = {
    "tetrahedron": TETRAHEDRON,
    "box": (grid(1)[0] * 2 - 1, grid(1)[1]),
    "sphere": sphere(1),
}


def placed(mesh: Mesh, scale: float, place: np.ndarray | tuple[float, ...]) -> Mesh:
    """The mesh, scaled, then moved, then rounded to float32."""
    return (mesh[0] * np.float64(scale) + np.asarray(place)).astype(np.float32), mesh[1]


def leaving(mesh: Mesh, count: int, random: np.random.Generator, spread: float = 0.1) -> Mesh:
    """Rays from inside, half of them at vertices, half at points of edges, as near as float32 allows."""
    vertices, faces = mesh
    ends = vertices[faces[random.integers(len(faces), size=count)]].astype(np.float64)
    weight = random.random((count, 1)) * random.integers(2, size=(count, 1))
    targets = ends[:, 0] * (1 - weight) + ends[:, 1] * weight
    low, high = vertices.min(axis=0).astype(np.float64), vertices.max(axis=0).astype(np.float64)
    origins = (low + high) / 2 + spread * (high - low) * random.uniform(-1, 1, (count, 3))
    origins = origins.astype(np.float32)
    return origins, (targets - origins).astype(np.float32)


def utm_terrain(size: int = 40, cell: float = 10.0) -> Mesh:
    """Hills over a square grid of metres in UTM zone coordinates, where float32 resolves half metres."""
    random = np.random.default_rng(41)
    across, up = np.meshgrid(np.arange(size + 1), np.arange(size + 1), indexing="ij")
    heights = 300 + 40 * np.sin(across / 5) * np.cos(up / 7) + random.random(across.shape)
    points = np.stack([500_000 + cell * across, 5_400_000 + cell * up, heights], axis=-1)
    a = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    b, c, d = a + size + 1, a + size + 2, a + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return points.reshape(-1, 3).astype(np.float32), faces.astype(np.int32)


def nearness(mesh: Mesh, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance (n,f) and t (n,f) of each line and each triangle, projected along the ray, in double.

    The distance is from the ray to the triangle's border, negative outside, in units of the distance
    by which rounding may move a corner in the watertight test (docs/accuracy.md): above 1 the ray is
    certainly inside, below -1 certainly outside.
    """
    axis = np.argmax(np.abs(directions), axis=1)
    order = (axis[:, None] + [1, 2, 3]) % 3
    ray = np.take_along_axis(directions.astype(np.float64), order, axis=1)[:, None]
    corners = []
    for corner in mesh[0][mesh[1]].astype(np.float64).swapaxes(0, 1):
        away = corner[None] - origins.astype(np.float64)[:, None]
        corners.append(np.take_along_axis(away, np.broadcast_to(order[:, None], away.shape), axis=2))
    flat = np.stack([p[..., :2] - ray[..., :2] / ray[..., 2:] * p[..., 2:] for p in corners])
    depth = np.stack([p[..., 2] for p in corners])
    weights, borders = [], []
    for k in range(3):
        a, b = flat[(k + 1) % 3], flat[(k + 2) % 3]
        weights.append(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
        side = b - a
        length = np.maximum((side**2).sum(axis=-1), np.finfo(np.float64).tiny)
        along = np.clip(-(a * side).sum(axis=-1) / length, 0, 1)
        borders.append(np.linalg.norm(a + along[..., None] * side, axis=-1))
    weight = np.stack(weights)
    total = weight.sum(axis=0)
    inside = (weight * np.sign(total) >= 0).all(axis=0) & (total != 0)
    magnitude = np.max([np.abs(p).max(axis=-1) for p in corners], axis=0)
    moved = 2**0.5 * 6 * 2.0**-24 * magnitude
    with np.errstate(all="ignore"):
        t = (weight * depth).sum(axis=0) / total / ray[..., 2]
    return np.where(inside, 1, -1) * np.min(borders, axis=0) / moved, t
