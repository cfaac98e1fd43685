"""Inputs on which the cost of a ray could jump, each with the input that it is compared to."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wive._internal.options import AccuracyOption, NodesOption
from wive._internal.precision import Floats

Part = Literal["scale", "distance", "plane", "doubt", "leaving"]
RADIUS = 0.1  # of the ball, in metres
USUAL_GROUND = 2.0  # metres across
GROUNDS = {2e3: 2.0, 2e4: 2.0, 2e5: 4.0}  # by how much a ray may cost more than above the usual one
DISTANCES = (1e1, 1e2, 1e3, 1e4, 1e5, 1e6)  # of the ball's radius
FARTHER, IN_PLANE, IN_DOUBT, LEAVING = 2.0, 100.0, 20.0, 2.0  # by how much rays may cost more
OUTSIDE = 1e-4  # where rays start that leave, over half the room's size
GRID = 700  # squares along a side of the flat part
COINCIDENT = 100_000

Faces = NDArray[np.int32]


@dataclass(frozen=True)
class Rays:
    """Rays at a mesh."""

    vertices: Floats
    faces: Faces
    origins: Floats
    directions: Floats
    accuracy: AccuracyOption = "watertight"
    nodes: NodesOption = "float32"
    one_by_one: bool = False  # instead of as a batch

    def typed(self, dtype: type[np.floating], accuracy: AccuracyOption) -> "Rays":
        """The same in this dtype and accuracy."""
        arrays = (array.astype(dtype) for array in (self.vertices, self.origins, self.directions))
        vertices, origins, directions = arrays
        return Rays(vertices, self.faces, origins, directions, accuracy)


@dataclass(frozen=True)
class Cliff:
    """An input, and the one that a ray may cost at most `bar` times as much as."""

    part: Part
    case: str
    rays: Rays
    near: Rays
    bar: float


# What float32 and float64 scenes answer by, and what takes float32 rays as they are.
KINDS: tuple[tuple[type[np.floating], AccuracyOption], ...] = (
    (np.float32, "watertight"),
    (np.float64, "watertight"),
    (np.float32, "exact"),
)


def cliffs(count: int, levels: int) -> Iterator[Cliff]:
    """All inputs: `count` rays each, at a ball of 20 * 4^levels triangles."""
    yield from _scale(count, levels)
    yield from _distance(count, levels)
    yield from _plane(min(count, 500))
    yield from _doubt(count, levels)
    yield from _leaving(count, levels)


def _scale(count: int, levels: int) -> Iterator[Cliff]:
    for dtype in (np.float32, np.float64):
        alone = _ball_above_ground(USUAL_GROUND, count, levels).typed(dtype, "watertight")
        for size, bar in GROUNDS.items():
            rays = _ball_above_ground(size, count, levels).typed(dtype, "watertight")
            yield Cliff("scale", f"{dtype.__name__}, ground of {size:g} m", rays, alone, bar)


def _distance(count: int, levels: int) -> Iterator[Cliff]:
    for dtype, accuracy in KINDS:
        near = _ball_above_ground(USUAL_GROUND, count, levels)
        for radii in DISTANCES:
            outwards = near.origins / np.linalg.norm(near.origins, axis=1, keepdims=True)
            origins = outwards * radii * RADIUS
            aims = outwards * RADIUS * 0.5
            rays = Rays(near.vertices, near.faces, origins, aims - origins).typed(dtype, accuracy)
            case = f"{dtype.__name__}, {accuracy}, from {radii:g} radii"
            yield Cliff("distance", case, rays, near.typed(dtype, accuracy), FARTHER)


def _plane(count: int) -> Iterator[Cliff]:
    """Rays within a flat grid, and across it."""
    random = np.random.default_rng(1)
    axis = np.arange(GRID + 1.0)
    vertices = np.stack([*np.meshgrid(axis, axis, indexing="ij"), np.zeros((GRID + 1, GRID + 1))], axis=-1)
    corner = (np.arange(GRID)[:, None] * (GRID + 1) + np.arange(GRID)).ravel()
    steps = np.array([[0, GRID + 1, GRID + 2], [0, GRID + 2, 1]])
    faces = (corner[:, None, None] + steps).reshape(-1, 3).astype(np.int32)
    origins = np.c_[random.random((count, 2)) * GRID, np.zeros(count)]
    angles = random.random(count) * 2 * np.pi
    within = Rays(vertices.reshape(-1, 3), faces, origins, np.c_[np.cos(angles), np.sin(angles), 0 * angles])
    down = np.tile([0.001, 0.002, -1.0], (count, 1))
    across = Rays(within.vertices, faces, origins + np.array([0, 0, 1]), down)
    for dtype, accuracy in KINDS:
        case = f"{dtype.__name__}, {accuracy}, within a floor"
        yield Cliff("plane", case, within.typed(dtype, accuracy), across.typed(dtype, accuracy), IN_PLANE)


def _doubt(count: int, levels: int) -> Iterator[Cliff]:
    """Rays for which `exact` needs integers, and the same in `fast`."""
    random = np.random.default_rng(2)
    vertices, faces = _ball(levels)
    ends = vertices[faces[random.integers(len(faces), size=count)]]
    anywhere = random.normal(size=(count, 3))
    turned = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]])
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    copies = turned[random.integers(6, size=COINCIDENT)].astype(np.int32)
    sets = {
        "from vertices": Rays(vertices, faces, ends[:, 0], anywhere),
        "to vertices": Rays(vertices, faces, np.zeros((count, 3)), ends[:, 0]),
        "along edges": Rays(vertices, faces, ends[:, 0], ends[:, 1] - ends[:, 0]),
        "coincident triangles": Rays(
            triangle, copies, np.tile([0.3, 0.3, 1.0], (2, 1)), np.tile([0.01, 0.02, -1.0], (2, 1))
        ),
    }
    for case, rays in sets.items():
        yield Cliff("doubt", case, rays.typed(np.float32, "exact"), rays.typed(np.float32, "fast"), IN_DOUBT)


def _leaving(count: int, levels: int) -> Iterator[Cliff]:
    """Rays from the outer side of a room around the ball, outwards, in both node forms."""
    random = np.random.default_rng(4)
    import trimesh

    vertices, faces = _ball(levels)
    room = trimesh.creation.box((2, 2, 2))
    origins = random.uniform(-1, 1, (count, 3))
    axes, ends = random.integers(3, size=count), random.choice([-1.0, 1.0], count)
    origins[np.arange(count), axes] = ends * (1 + OUTSIDE)
    directions = random.normal(size=(count, 3))
    directions[np.arange(count), axes] = ends * np.abs(directions[np.arange(count), axes])
    solid = np.vstack([faces, room.faces + len(vertices)]).astype(np.int32)
    usual = Rays(np.vstack([vertices * RADIUS, room.vertices]), solid, origins, directions)
    usual = usual.typed(np.float32, "watertight")
    for case, one_by_one in (("compressed nodes", False), ("compressed nodes, one by one", True)):
        rays = replace(usual, one_by_one=one_by_one)
        yield Cliff("leaving", case, replace(rays, nodes="compressed"), rays, LEAVING)


def _ball_above_ground(size: float, count: int, levels: int) -> Rays:
    """A ball in the middle of one large triangle, and rays at it from half a metre away."""
    random = np.random.default_rng(0)
    vertices, faces = _ball(levels)
    half = size / 2
    ground = np.array([[-half, -half, -0.3], [half, -half, -0.3], [0, half, -0.3]])
    outwards = random.normal(size=(count, 3))
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    faces = np.vstack([faces, [[len(vertices), len(vertices) + 1, len(vertices) + 2]]]).astype(np.int32)
    origins = outwards * 0.5
    aims = random.uniform(-0.5, 0.5, (count, 3)) * RADIUS
    return Rays(np.vstack([vertices * RADIUS, ground]), faces, origins, aims - origins)


def _ball(levels: int) -> tuple[Floats, Faces]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=levels)
    return np.asarray(ball.vertices, np.float64), np.asarray(ball.faces, np.int32)
