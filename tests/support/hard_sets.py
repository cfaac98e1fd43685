"""Meshes and rays at which rounding goes wrong: few bits, slivers, coincident faces, extreme exponents."""

import functools
from typing import NamedTuple

import numpy as np

from support.closed_meshes import grid
from support.meshes import soup, sphere


class HardSet(NamedTuple):
    """A mesh and (n,3) rays."""

    vertices: np.ndarray
    faces: np.ndarray
    origins: np.ndarray
    directions: np.ndarray


def few_bits(random: np.random.Generator, count: int, largest: int) -> np.ndarray:
    """(count,3) small integers, as float32."""
    return random.integers(-largest, largest + 1, (count, 3)).astype(np.float32)


def separate(count: int) -> np.ndarray:
    """Faces of which each has three vertices of its own."""
    return np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def small_integers() -> HardSet:
    """Most rays meet vertices, edges or planes exactly, and several triangles at one t."""
    random = np.random.default_rng(21)
    faces = random.integers(40, size=(60, 3)).astype(np.int32)
    return HardSet(few_bits(random, 40, 3), faces, few_bits(random, 1200, 5), few_bits(random, 1200, 3))


def wide_integers(bits: int) -> HardSet:
    """Small integers, some of them times 2^bits; every ray meets a vertex exactly."""
    random = np.random.default_rng(34)
    scale = np.ldexp(1.0, bits * random.integers(2, size=(40, 3))).astype(np.float32)
    vertices = few_bits(random, 40, 7) * scale
    met = random.integers(40, size=1200)
    directions = few_bits(random, 1200, 3) * scale[met]
    origins = vertices[met] - directions * random.integers(1, 3, (1200, 1)).astype(np.float32)
    return HardSet(vertices, random.integers(40, size=(60, 3)).astype(np.int32), origins, directions)


def axis_rays_on_a_grid() -> HardSet:
    """A closed box of integer cells; rays along the axes at every half cell, its border included."""
    vertices, faces = grid(4)
    places = np.stack(np.meshgrid(*[np.arange(-0.5, 5, 0.5)] * 2), axis=-1).reshape(-1, 2)
    origins, directions = [], []
    for axis in range(3):
        for side, start in ((1.0, -3.0), (-1.0, 7.0), (1.0, 2.0)):
            origins.append(np.insert(places, axis, start, axis=1))
            directions.append(np.tile(side * np.eye(3)[axis], (len(places), 1)))
    return HardSet(vertices, faces, *(np.concatenate(a).astype(np.float32) for a in (origins, directions)))


def aimed(vertices: np.ndarray, faces: np.ndarray, seed: int, count: int, distance: float) -> HardSet:
    """Rays at vertices, at points of edges and of faces, as near to them as float32 allows."""
    random = np.random.default_rng(seed)
    corners = vertices[faces[random.integers(len(faces), size=count)]].astype(np.float64)
    share = random.dirichlet((1, 1, 1), count) * (random.random((count, 3)) < 0.6)
    share[share.sum(axis=1) == 0] = (1, 0, 0)
    targets = (corners * (share / share.sum(axis=1, keepdims=True))[..., None]).sum(axis=1)
    size = np.ptp(vertices.astype(np.float64), axis=0).max()
    middle = (vertices.min(axis=0).astype(np.float64) + vertices.max(axis=0)) / 2
    origins = (middle + distance * size * random.uniform(-1, 1, (count, 3))).astype(np.float32)
    return HardSet(vertices, faces, origins, (targets - origins).astype(np.float32))


def slivers() -> HardSet:
    """Triangles whose third corner is a rounded point of the opposite side."""
    random = np.random.default_rng(22)
    a, b = random.random((2, 60, 3))
    c = a + random.random((60, 1)) * (b - a)
    corners = np.stack([a, b, c], axis=1).astype(np.float32).reshape(-1, 3)
    return aimed(corners, separate(60), 23, 1200, 1.5)


def coincident_faces() -> HardSet:
    """Triangles of one plane, each several times with its corners in another order."""
    random = np.random.default_rng(24)
    flat = random.integers(-4, 5, (12, 2))
    vertices = np.stack([*flat.T, flat[:, 0] + 2 * flat[:, 1]], axis=1).astype(np.float32) / 8
    faces = random.integers(12, size=(20, 3))
    faces = np.concatenate([faces[:, order] for order in ((2, 1, 0), (0, 1, 2), (1, 2, 0))])
    faces = faces[random.permutation(len(faces))].astype(np.int32)
    return aimed(vertices, faces, 33, 900, 0.8)


def thin_walls() -> HardSet:
    """Walls 1e-5 to 2e-7 apart, the far ones with the lower numbers, some of which cross."""
    random = np.random.default_rng(25)
    square = np.array([[-1, -1, 1], [1, -1, 1], [0, 1, 1]])
    walls = [square + np.array([0, 0, gap]) for gap in (1e-5, 1e-6, 3e-7, 2e-7, 0)]
    walls += [
        square + np.append(np.zeros((3, 2)), 1e-7 * random.standard_normal((3, 1)), axis=1) for _ in range(8)
    ]
    directions = np.append(random.uniform(-0.9, 0.9, (1500, 2)), np.ones((1500, 1)), axis=1).astype(
        np.float32
    )
    origins = np.zeros_like(directions)
    return HardSet(np.concatenate(walls).astype(np.float32), separate(len(walls)), origins, directions)


def nearly_in_plane() -> HardSet:
    """Nearly coplanar triangles and rays nearly in their plane."""
    random = np.random.default_rng(26)
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    flat = np.append(random.uniform(-1, 1, (180, 2)), 3e-7 * random.standard_normal((180, 1)), axis=1)
    ends = np.append(random.uniform(-2, 2, (2, 1200, 2)), 1e-6 * random.standard_normal((2, 1200, 1)), axis=2)
    origins, targets = (ends @ turn).astype(np.float32)
    return HardSet((flat @ turn).astype(np.float32), separate(60), origins, targets - origins)


def moved_sphere(scale: float, place: tuple[float, float, float] = (0, 0, 0)) -> HardSet:
    vertices, faces = sphere(1, radius=scale)
    moved = (vertices + np.array(place)).astype(np.float32)
    return aimed(moved, faces, 27, 700, 0.9)


def far_origins() -> HardSet:
    """Rays from up to 1e7 sizes away, where the float filter decides least."""
    random = np.random.default_rng(28)
    vertices, faces = sphere(1)
    rays = aimed(vertices, faces, 29, 900, 1.0)
    origins = (rays.origins * 10 ** random.uniform(0, 7, (900, 1))).astype(np.float32)
    targets = (rays.directions.astype(np.float64) + rays.origins).astype(np.float32)
    return rays._replace(
        origins=origins, directions=(targets.astype(np.float64) - origins).astype(np.float32)
    )


def scaled_soup(scale: float, length: float) -> HardSet:
    """Coordinates of that scale, directions of that length; both reach into subnormal numbers."""
    vertices, faces = soup(50, 30)
    rays = aimed(vertices, faces, 31, 500, 1.0)
    with np.errstate(under="ignore"):
        return HardSet(
            *((vertices * scale).astype(np.float32), faces, (rays.origins * scale).astype(np.float32)),
            (rays.directions * length).astype(np.float32),
        )


def mixed_exponents() -> HardSet:
    """Numbers of any magnitude that float32 and the scene's limits allow, side by side in one mesh."""
    random = np.random.default_rng(32)

    def numbers(count: int, low: int, high: int) -> np.ndarray:
        sizes = random.integers(low, high, (count, 3)) * (random.random((count, 1)) < 0.8)
        return np.ldexp(random.integers(-3, 4, (count, 3)), sizes).astype(np.float32)

    return HardSet(numbers(120, -149, 57), separate(40), numbers(1500, -149, 57), numbers(1500, -149, 125))


SETS = {
    "small integers": small_integers,
    "the widest for 128 bits": lambda: wide_integers(12),
    "too wide for 128 bits": lambda: wide_integers(18),
    "axis rays on a grid": axis_rays_on_a_grid,
    "slivers": slivers,
    "coincident faces": coincident_faces,
    "thin walls": thin_walls,
    "nearly in plane": nearly_in_plane,
    "sphere": lambda: moved_sphere(1.0),
    "tiny sphere": lambda: moved_sphere(1e-6),
    "huge sphere": lambda: moved_sphere(1e6),
    "sphere far away": lambda: moved_sphere(1000.0, (148376, 1234, -223423)),
    "far origins": far_origins,
    "subnormal coordinates": lambda: scaled_soup(1e-38, 1.0),
    "subnormal directions": lambda: scaled_soup(1.0, 1e-43),
    "subnormal distances": lambda: scaled_soup(1e-5, 1e37),
    "overflowing distances": lambda: scaled_soup(1e17, 1e-30),
    "mixed exponents": mixed_exponents,
}


@functools.cache
def hard_set(name: str) -> HardSet:
    """The set of that name; rays without a direction are left out."""
    chosen = HardSet(*(np.ascontiguousarray(array) for array in SETS[name]()))
    moving = (chosen.directions != 0).any(axis=1)
    return chosen._replace(origins=chosen.origins[moving], directions=chosen.directions[moving])
