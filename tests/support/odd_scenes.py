"""Small scenes and rays of any bits: what no one would draw, but a broken file or program may pass."""

from collections.abc import Callable

import numpy as np

from support.batches import Batch
from support.closed_meshes import grid

Random = np.random.Generator
Mesh = tuple[np.ndarray, np.ndarray]

LARGEST = 1e18  # coordinate that a scene takes
COUNTS = (1, 2, 3, 4, 5, 8, 9, 17, 33, 70)  # of triangles: one block, full and overfull blocks, several nodes
SPECIAL = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    1 + 2**-23,
    1 - 2**-24,
    1 / 3,
    16777215.0,
    1e-30,
    5e-324,
    1e-45,
    -1e-38,
    1e18,
    -1e18,
)


def odd_case(seed: int, dtype: type[np.floating], rays: int = 64) -> Batch:
    """The mesh and rays of a seed: finite vertices within the limit, rays of any bits, a limit each."""
    with np.errstate(all="ignore"):  # bits that overflow and are no numbers are wanted
        return _case(np.random.default_rng(seed), dtype, rays)


def _case(random: Random, dtype: type[np.floating], rays: int) -> Batch:
    vertices, faces = odd_mesh(random, dtype)
    corners = vertices[faces]
    targets = points_of(corners, rays, random)
    origins = pick(
        random, rays, [any_point(random, rays, dtype), points_of(corners, rays, random), targets - 1]
    )
    ways = [
        targets - origins,
        axes(random, rays),
        any_point(random, rays, dtype),
        small_integers(random, rays),
    ]
    directions = pick(random, rays, ways).astype(dtype)
    number = random.random(rays)
    tmin = np.select([number < 0.6, number < 0.8], [0.0, -np.inf], random.normal(size=rays)).astype(dtype)
    tmax = np.select([number < 0.7, number < 0.9], [np.inf, 1.0], tmin + random.random(rays)).astype(dtype)
    bad = random.random(rays) < 0.03
    directions[bad, random.integers(3)] = random.choice([np.nan, np.inf, 0.0])
    return Batch(vertices, faces, origins.astype(dtype), directions, tmin, tmax)


def odd_mesh(random: Random, dtype: type[np.floating]) -> Mesh:
    """Triangles of one kind, some repeated, some without area."""
    if random.random() < 0.15:
        vertices, faces = grid(2)
        return (vertices * random.choice([1, 0.5, 3])).astype(dtype), faces
    count = int(random.choice(COUNTS))
    kind: Callable[[Random, int, type[np.floating]], np.ndarray] = random.choice(np.array(KINDS, object))
    corners = kind(random, 3 * count, dtype).reshape(count, 3, 3)
    if random.random() < 0.2:
        corners[random.integers(count, size=count // 2 + 1)] = corners[random.integers(count)]
    if random.random() < 0.2:
        corners[0, 2] = corners[0, 1]
    if random.random() < 0.2:
        corners[..., random.integers(3)] = corners[0, 0, random.integers(3)]
    vertices = np.clip(np.nan_to_num(corners.reshape(-1, 3)), -LARGEST, LARGEST).astype(dtype)
    return vertices, random.permutation(3 * count).reshape(-1, 3).astype(np.int32)


def any_bits(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    """Numbers of every exponent."""
    return np.frombuffer(random.bytes(3 * count * np.dtype(dtype).itemsize), dtype).reshape(-1, 3).copy()


def moderate(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    """Numbers of one scale and place."""
    scale, place = 2.0 ** random.integers(-100, 50), random.choice([0.0, 0.0, 1e3, 1e7])
    return ((random.random((count, 3)) + place) * scale).astype(dtype)


def small_integers(random: Random, count: int, dtype: type[np.floating] = np.float64) -> np.ndarray:
    """Points of a grid, so that rays meet edges, vertices and planes exactly."""
    return random.integers(-3, 4, (count, 3)).astype(dtype)


def special(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    """Zeros of both signs, subnormals, neighbours of one, the largest coordinates."""
    return random.choice(SPECIAL, (count, 3)).astype(dtype)


def growing(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    """Triangles each twice as large as the one before, which make deep trees."""
    sizes = 2.0 ** (np.arange(count) // 3 % 55)
    return (random.normal(size=(count, 3)) * sizes[:, None]).astype(dtype)


KINDS = (any_bits, moderate, moderate, small_integers, small_integers, special, growing)


def any_point(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    kind: Callable[[Random, int, type[np.floating]], np.ndarray] = random.choice(np.array(KINDS, object))
    return kind(random, count, dtype).astype(np.float64)


def points_of(corners: np.ndarray, count: int, random: Random) -> np.ndarray:
    """Vertices, points of edges and of faces of random triangles."""
    weights = random.dirichlet((1, 1, 1), count)
    weights[random.random((count, 3)) < 0.3] = 0
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 0, weights / np.where(total > 0, total, 1), [1.0, 0, 0])
    return (corners[random.integers(len(corners), size=count)].astype(np.float64) * weights[..., None]).sum(
        axis=1
    )


def axes(random: Random, count: int) -> np.ndarray:
    """Directions along axes and diagonals, with zeros of both signs."""
    return random.choice([0.0, -0.0, 1.0, -1.0], (count, 3))


def pick(random: Random, count: int, ways: list[np.ndarray]) -> np.ndarray:
    """Each row from one of the arrays."""
    return np.stack(ways)[random.integers(len(ways), size=count), np.arange(count)]
