"""Small meshes, rays for them, a brute-force oracle, and a comparison of hits."""

import numpy as np

import wive

TRIANGLE = (
    np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]], np.float32),
    np.array([[0, 1, 2]], np.int32),
)


def sphere(level: int = 3, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A closed icosphere of 20 * 4**level triangles, wound outwards."""
    golden = (1 + 5**0.5) / 2
    ring = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    points = np.array([np.roll(point, shift) for shift in (0, 1, 2) for point in ring], np.float64)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    edge = min(np.linalg.norm(points[0] - other) for other in points[1:])
    corners = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if all(np.linalg.norm(points[i] - points[j]) < edge * 1.01 for i, j in ((a, b), (b, c), (a, c)))
    ]
    faces = np.array([f if np.linalg.det(points[list(f)]) > 0 else f[::-1] for f in corners])
    for _ in range(level):
        sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
        unique, inverse = np.unique(sides, axis=0, return_inverse=True)
        middles = points[unique].mean(axis=1)
        ab, bc, ca = (len(points) + inverse.reshape(-1, 3)).T
        points = np.concatenate([points, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
        a, b, c = faces.T
        faces = np.concatenate(
            [np.stack(f, axis=1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return (points * radius).astype(np.float32), faces.astype(np.int32)


def soup(count: int, seed: int, size: float = 0.2, dtype: type = np.float32) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of random place and direction in the unit cube."""
    random = np.random.default_rng(seed)
    corners = random.random((count, 1, 3)) + size * random.standard_normal((count, 3, 3))
    return corners.reshape(-1, 3).astype(dtype), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def random_rays(
    count: int, seed: int, low: float = -1.5, high: float = 1.5, dtype: type = np.float32
) -> tuple[np.ndarray, np.ndarray]:
    """Rays from random points of a cube in random directions, not of unit length."""
    random = np.random.default_rng(seed)
    origins = random.uniform(low, high, (count, 3)).astype(dtype)
    return origins, random.standard_normal((count, 3)).astype(dtype)


def all_crossings(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Every ray against every triangle in float64: t (n,f), inf on a miss, and clearness (n,f).

    Clearness is the least distance, in barycentrics, to the border between hit and miss.
    """
    v0, v1, v2 = vertices[faces].astype(np.float64).swapaxes(0, 1)
    edge1, edge2 = v1 - v0, v2 - v0
    direction = directions.astype(np.float64)[:, None]
    with np.errstate(all="ignore"):
        p = np.cross(direction, edge2[None])
        determinant = np.sum(edge1 * p, axis=-1)
        s = origins.astype(np.float64)[:, None] - v0
        u = np.sum(s * p, axis=-1) / determinant
        q = np.cross(s, edge1[None])
        v = np.sum(direction * q, axis=-1) / determinant
        t = np.sum(edge2 * q, axis=-1) / determinant
        inside = np.minimum(np.minimum(u, v), 1 - u - v)
        return np.where((inside >= 0) & (t >= 0), t, np.inf), np.minimum(abs(inside), abs(t))


def assert_same_hits(one: wive.Hits, other: wive.Hits) -> None:
    np.testing.assert_array_equal(one.prim, other.prim)
    np.testing.assert_array_equal(one.t, other.t)
    np.testing.assert_array_equal(one.uv, other.uv)
