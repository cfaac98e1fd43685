"""Small scenes and rays of any bits: what no one would draw, but a broken file or program may pass."""

from collections.abc import Callable

import numpy as np

from support.batches import Batch
from support.closed_meshes import grid

Random = np.random.Generator
Mesh = tuple[np.ndarray, np.ndarray]

LARGEST = 1e18  # coordinate that a scene takes
COUNTS = (1, 2, 3, 4, 5, 8, 9, 17, 33, 70)  # of triangles: one block, full and overfull blocks, several nodes
# Of rays: none, one, around the lanes of every instruction set and around what a thread takes at once.
BATCHES = (0, 1, 7, 8, 9, 15, 16, 17, 64, 64, 64, 64, 255, 256, 257)
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
TMIN = (-np.inf, -1.0, -0.0, 5e-324, 1e-45, 1e-38, 1e30, np.inf, np.nan, -1e300)
TMAX = (np.inf, 1.0, 0.0, -0.0, 1e-45, 3e38, 1e300, -np.inf, np.nan, -1.0)


def odd_case(
    seed: int, dtype: type[np.floating], rays: int | None = None, ray_dtype: type[np.floating] | None = None
) -> Batch:
    """The mesh and rays of a seed: vertices within the limit if a triangle uses them, rays of any bits.

    `dtype` is of the vertices, and of the rays if `ray_dtype` is None.
    """
    with np.errstate(all="ignore"):  # bits that overflow and are no numbers are wanted
        random = np.random.default_rng(seed)
        count = int(random.choice(BATCHES)) if rays is None else rays
        return _case(random, dtype, count, ray_dtype or dtype)


def _case(random: Random, dtype: type[np.floating], rays: int, ray_dtype: type[np.floating]) -> Batch:
    vertices, faces = odd_mesh(random, dtype)
    corners = vertices[faces]
    targets = points_of(corners, rays, random)
    origins = pick(
        random,
        rays,
        [
            any_point(random, rays, ray_dtype),
            points_of(corners, rays, random),
            targets - 1,
            far(random, targets),
        ],
    )
    ways = [
        targets - origins,
        (targets - origins) * 2.0 ** random.integers(-150, 100),
        axes(random, rays),
        any_point(random, rays, ray_dtype),
        small_integers(random, rays),
    ]
    directions = pick(random, rays, ways).astype(ray_dtype)
    number = random.random((2, rays))
    tmin = np.select([number[0] < 0.6, number[0] < 0.8], [0.0, -np.inf], random.normal(size=rays))
    tmax = np.select([number[1] < 0.7, number[1] < 0.9], [np.inf, 1.0], tmin + random.random(rays))
    tmin = np.where(random.random(rays) < 0.05, random.choice(TMIN, rays), tmin)
    tmax = np.where(random.random(rays) < 0.05, random.choice(TMAX, rays), tmax)
    for array in (origins, directions):
        bad = random.random(rays) < 0.03
        array[bad, random.integers(3)] = random.choice([np.nan, np.inf, -np.inf, 0.0, -0.0])
    return Batch(vertices, faces, *(array.astype(ray_dtype) for array in (origins, directions, tmin, tmax)))


def odd_mesh(random: Random, dtype: type[np.floating]) -> Mesh:
    """Triangles of one kind, some repeated, some without area; vertices that none uses may be anything."""
    if random.random() < 0.15:
        vertices, faces = grid(2)
        return (vertices * random.choice([1, 0.5, 3])).astype(dtype), faces
    count = int(random.choice(COUNTS))
    corners = point_of_kind(random, 3 * count, dtype).reshape(count, 3, 3)
    if random.random() < 0.2:
        corners[random.integers(count, size=count // 2 + 1)] = corners[random.integers(count)]
    if random.random() < 0.2:
        corners[0, 2] = corners[0, 1]
    if random.random() < 0.2:
        corners[..., random.integers(3)] = corners[0, 0, random.integers(3)]
    if random.random() < 0.1:  # needles
        corners[:, 1:] = corners[:, :1] + 1e-6 * (corners[:, 1:] - corners[:, :1])
        corners[:, 2] *= random.choice([-1e6, 1e12])
    points = np.clip(np.nan_to_num(corners.reshape(-1, 3)), -LARGEST, LARGEST).astype(dtype)
    unused = any_bits(random, int(random.integers(4)), dtype)
    unused[: len(unused) // 2] = random.choice([np.nan, np.inf, -np.inf])
    vertices = np.concatenate([points, unused])
    order = random.permutation(len(vertices))
    vertices[order] = vertices.copy()
    return vertices, order[: 3 * count].reshape(-1, 3).astype(np.int32)


def point_of_kind(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    kind: Callable[[Random, int, type[np.floating]], np.ndarray] = random.choice(np.array(KINDS, object))
    return kind(random, count, dtype)


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


def subnormal(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    """Small multiples of the smallest number, and some at the border of the subnormal ones."""
    info = np.finfo(dtype)
    points = random.integers(-9, 10, (count, 3)).astype(dtype) * info.smallest_subnormal
    return np.where(random.random((count, 3)) < 0.1, random.choice([info.tiny, -info.tiny]), points)


def mixed(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    """Triangles, or vertices, each of its own scale, from the smallest numbers to the largest."""
    own = random.integers(-149, 60, count)
    scales = 2.0 ** (own if random.random() < 0.3 else own[np.arange(count) // 3])
    return (random.normal(size=(count, 3)) * scales[:, None]).astype(dtype)


def neighbours(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    """Numbers within a few units in the last place of one point: slivers, and boxes without extent."""
    place = random.choice([1.0, -1 / 3, 1e7, 1e-38, LARGEST], 3).astype(dtype)
    return place - random.integers(0, 4, (count, 3)).astype(dtype) * np.spacing(place)


KINDS = (any_bits, moderate, moderate, small_integers, small_integers, special, growing, subnormal, mixed,
         neighbours)  # fmt: skip


def any_point(random: Random, count: int, dtype: type[np.floating]) -> np.ndarray:
    return point_of_kind(random, count, dtype).astype(np.float64)


def far(random: Random, targets: np.ndarray) -> np.ndarray:
    """Points far away from the targets, each by its own distance."""
    distances = 10.0 ** random.uniform(0, 18, len(targets))
    return np.clip(targets + random.normal(size=targets.shape) * distances[:, None], -LARGEST, LARGEST)


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
