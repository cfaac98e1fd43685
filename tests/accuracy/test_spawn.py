"""Rays from `Hits.spawn` don't hit the triangle they leave: any size, place, side and direction."""

import re

import numpy as np
import pytest
from support.meshes import TRIANGLE, sphere
from support.spawned_rays import (
    COUNT,
    EXPONENTS,
    SLIVERS,
    TRANSLATED,
    assert_origins_on_the_side,
    hits_of,
    leave,
    own_hits,
    triangles,
    ways_out,
)

import wive
from wive._internal import spawn

ACCURACIES = ("fast", "watertight", "exact")
UTM = np.array([148376.0, 1234.0, -223423.0])


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("shape", EXPONENTS + TRANSLATED + SLIVERS)
def test_spawned_rays_never_hit_their_own_triangle(shape: tuple[float, float, float], accuracy: str) -> None:
    # Few of the rays aimed at slivers from beside hit.
    for slope, hit in ((1.0, COUNT / 2), (1e-4, COUNT / 10)):
        scene, hits, incoming = hits_of(triangles(*shape), accuracy, slope)
        assert hits.mask.sum() > hit
        assert own_hits(scene, hits, incoming) == 0


def test_even_needles_keep_the_promise_in_watertight() -> None:
    for width in (1e-5, 1e-6):
        scene, hits, incoming = hits_of(triangles(1.0, 1.0, width), "watertight")
        assert hits.mask.sum() > COUNT / 2
        assert own_hits(scene, hits, incoming) == 0


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_a_fiftieth_of_the_offset_is_not_enough(accuracy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rounding = spawn.ROUNDINGS["float32"]
    names = ["fast"] if accuracy == "fast" else ["corner", "weights"]
    fiftieths = {name: 0.02 * getattr(rounding, name) for name in names}
    monkeypatch.setitem(spawn.ROUNDINGS, "float32", rounding._replace(**fiftieths))
    assert sum(own_hits(*hits_of(triangles(*shape), accuracy)) for shape in EXPONENTS + SLIVERS) > 0


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_points_merely_rounded_do_hit_again_so_these_rays_can_tell(accuracy: str) -> None:
    scene, hits, incoming = hits_of(triangles(1.0, 1.0, 1.0), accuracy)
    directions = ways_out(hits, incoming)[3]
    again = scene.intersect_all(hits.points().astype(np.float32), directions, touching=True)
    assert (again.prim == hits.prim[again.ray]).sum() > COUNT / 10


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("shape", [*EXPONENTS[::4], *TRANSLATED[::3], SLIVERS[1]])
def test_origins_lie_strictly_on_the_side_of_the_direction(
    shape: tuple[float, float, float], accuracy: str
) -> None:
    _, hits, incoming = hits_of(triangles(*shape), accuracy)
    assert_origins_on_the_side(hits, ways_out(hits, incoming)[:5])


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("place", [np.zeros(3), UTM])
@pytest.mark.parametrize("radius", [1e-6, 1.0, 1e3, 1e6])
def test_origins_move_by_no_more_than_64_units_in_the_last_place(
    radius: float, place: np.ndarray, accuracy: str
) -> None:
    vertices, faces = sphere(2, radius)
    vertices = (vertices + radius * place).astype(np.float32)
    directions = np.random.default_rng(4).standard_normal((2000, 3)).astype(np.float32)
    scene = wive.Scene(vertices, faces, accuracy=accuracy)
    hits = scene.intersect((radius * place).astype(np.float32), directions)
    corners = vertices[faces[hits.prim]].astype(np.float64)
    size = abs(corners - hits.points()[:, None]).max(axis=(1, 2))
    coordinate = abs(corners).max(axis=(1, 2))
    moved = np.linalg.norm(hits.spawn(-directions) - hits.points(), axis=1)
    assert hits.mask.all()
    assert (moved <= 64 * np.spacing(np.maximum(size, coordinate).astype(np.float32))).all()
    if accuracy == "exact":  # one rounding, and the error of double
        assert (moved <= 2 * np.spacing(coordinate.astype(np.float32))).all()


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("radius", [1e-6, 1.0, 1e6])
def test_rays_that_leave_a_convex_body_never_hit_it_again(radius: float, accuracy: str) -> None:
    outwards, inwards = leave(wive.Scene(*sphere(5, radius), accuracy=accuracy), np.zeros(3), seed=5)
    assert not outwards.any()
    assert inwards.all() or accuracy == "fast"


@pytest.mark.parametrize("accuracy", ["watertight", "exact"])
def test_rays_inside_a_closed_body_far_away_hit_it(accuracy: str) -> None:
    vertices, faces = sphere(3, 1000.0)
    vertices = (vertices + UTM).astype(np.float32)
    _, inwards = leave(wive.Scene(vertices, faces, accuracy=accuracy), UTM, seed=7)
    assert inwards.all()


def tessellated_plane(slope: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A grid of integer corners in one plane exactly, far from the origin."""
    steps = np.arange(48)
    x, y = (axis.ravel() for axis in np.meshgrid(steps * 8, steps * 8, indexing="ij"))
    z = slope[0] * x + slope[1] * y
    corner = (steps[:-1, None] * 48 + steps[:-1]).ravel()
    a, b, c, d = corner, corner + 48, corner + 49, corner + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return (np.stack([x, y, z], axis=1) + UTM.round()).astype(np.float32), faces


@pytest.mark.parametrize("accuracy", ["watertight", "exact"])
@pytest.mark.parametrize("slope", [(0, 0), (1, 2)])
def test_rays_that_leave_a_tessellated_plane_far_away_never_hit_it_again(
    slope: tuple[int, int], accuracy: str
) -> None:
    random = np.random.default_rng(6)
    vertices, faces = tessellated_plane(slope)
    weights = random.dirichlet(np.ones(3), 20_000)
    weights[::3] = np.eye(3)[random.integers(3, size=len(weights[::3]))]
    corners = vertices[faces[random.integers(len(faces), size=20_000)]]
    targets = np.einsum("nk,nkx->nx", weights, corners.astype(np.float64))
    origins = (targets + np.array([3, 5, 400])).astype(np.float32)
    scene = wive.Scene(vertices, faces, accuracy=accuracy)
    hits = scene.intersect(origins, (targets - origins).astype(np.float32))
    assert hits.mask.mean() > 0.95  # some are aimed at the border
    for directions in ways_out(hits, origins.astype(np.float64)):
        # Neighbours are met by no ray on either side, however flat.
        assert not scene.occluded(hits.spawn(directions), directions).any()


def test_misses_spawn_rays_that_miss() -> None:
    scene = wive.Scene(*TRIANGLE)
    hits = scene.intersect([[0.2, 0.2, 0], [5, 5, 0]], [0, 0, 1])
    origins = hits.spawn([0, 0, -1])
    assert origins.dtype == np.float32 and origins.shape == (2, 3)
    assert np.isnan(origins[1]).all() and not np.isnan(origins[0]).any()
    assert not scene.occluded(origins, [0, 0, -1]).any()
    assert wive.Scene(*TRIANGLE).intersect(np.zeros((0, 3)), np.zeros((0, 3))).spawn([0, 0, 1]).shape == (
        0,
        3,
    )


def test_origins_depend_on_the_side_alone_and_cross_the_surface() -> None:
    hits = wive.Scene(*TRIANGLE).intersect([[0.2, 0.2, 0]], [0, 0, 1])
    above, below = hits.spawn([0, 0, 1]), hits.spawn([[0, 0, -1]])
    assert above[0, 2] > 1 > below[0, 2]
    np.testing.assert_array_equal(above, hits.spawn([[5, 5, 1e-3]]))
    np.testing.assert_array_equal(above, hits.spawn(np.array([[5, -5, 0]], np.float64)))  # in the plane


@pytest.mark.parametrize(
    ("directions", "error", "text"),
    [
        (np.zeros((3, 3)), ValueError, "have shape (2, 3), one per hit, or (3,), got (3, 3)"),
        (np.zeros(2), ValueError, "have shape (n, 3), or (3,) if all rays share it, got (2,)"),
        (["up"], TypeError, "be an (n, 3) array of real numbers, got dtype <U2: convert it first"),
    ],
)
def test_bad_directions_are_named(directions: object, error: type[Exception], text: str) -> None:
    hits = wive.Scene(*TRIANGLE).intersect(np.zeros((2, 3)), [0.1, 0.1, 1])
    with pytest.raises(error, match=f"^{re.escape(f'directions must {text}')}$"):
        hits.spawn(directions)
