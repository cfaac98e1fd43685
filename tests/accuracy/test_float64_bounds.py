"""`Hits.error_bound` and `Hits.spawn` hold in float64, in which they are computed themselves."""

from collections.abc import Callable

import numpy as np
import pytest
from support.doubles import CPU, UTM, survey
from support.error_bounds import (
    COUNT,
    SETS,
    Set,
    aimed,
    broken,
    exact_t,
    random_triangles,
    traced,
)
from support.meshes import TRIANGLE
from support.spawned_rays import (
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
from wive._internal import error_bounds, spawn

ACCURACIES = ("fast", "watertight")
# Sizes beyond float32's range, and needles as thin as double just resolves.
SHAPES = [
    *EXPONENTS[::3], *TRANSLATED, *SLIVERS,
    (1e-30, 1e-30, 1.0), (1e16, 1e16, 1.0), (1e9, 1e-3, 1.0), (1.0, 1.0, 1e-7),
]  # fmt: skip


def extremes(dtype: type = np.float64) -> Set:
    """Sizes whose products come near the ends of double's range, and directions of any length in it."""
    random = np.random.default_rng(9)
    corners, direction = random_triangles(random)
    scale = 10.0 ** random.uniform(-60, 16, (COUNT, 1))
    *mesh, origins, directions = aimed(corners * scale[:, None], random, scale, direction, dtype)
    return *mesh, origins, directions * 10.0 ** random.uniform(-100, 200, (COUNT, 1))


def needles(dtype: type = np.float64) -> Set:
    """Triangles as thin, and rays as flat, as double just resolves."""
    random = np.random.default_rng(10)
    corners, direction = random_triangles(random)
    corners[:, 2] = (corners[:, 0] + corners[:, 1]) / 2 + 10.0 ** random.uniform(
        -14, -8, (COUNT, 1)
    ) * corners[:, 2]
    return aimed(corners, random, 3.0, direction, dtype)


ALL = (*SETS, extremes)


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("make", ALL)
def test_t_is_within_its_bound_of_the_exact_distance(make: Callable[..., Set], accuracy: str) -> None:
    hits, exact = traced(make, accuracy, dtype=np.float64)
    assert hits.t.dtype == np.float64
    assert broken(hits, exact, hits.error_bound) == 0
    assert np.isfinite(hits.error_bound[hits.mask]).mean() > 0.95


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_rays_that_double_can_not_tell_from_a_plane_have_no_bound(accuracy: str) -> None:
    vertices, faces, origins, directions = needles()
    hits = wive.Scene(vertices, faces, accuracy=accuracy).intersect(origins, directions)
    bounds = hits.error_bound[hits.mask]
    assert len(bounds) > COUNT / 10
    assert np.isinf(bounds).any() and np.isfinite(bounds).any()
    assert broken(hits, exact_t(hits, origins, directions), hits.error_bound) == 0


def test_the_error_of_the_bounds_own_arithmetic_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(error_bounds, "ROUNDINGS", 0)
    for accuracy in ACCURACIES:
        hits, exact = traced(SETS[0], accuracy, dtype=np.float64)
        assert broken(hits, exact, hits.error_bound) > COUNT / 20


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_a_well_conditioned_t_is_known_to_some_tens_of_units_in_the_last_place(accuracy: str) -> None:
    hits, _ = traced(SETS[0], accuracy, dtype=np.float64)
    in_units = hits.error_bound / np.spacing(hits.t)
    assert np.median(in_units) < 40
    assert in_units.max() < 200


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_at_survey_coordinates_t_is_known_to_the_mesh_and_not_to_its_place(accuracy: str) -> None:
    vertices, faces = survey(3)
    directions = np.random.default_rng(1).standard_normal((2000, 3))
    hits = wive.Scene(vertices, faces, accuracy=accuracy).intersect(UTM, directions)
    assert hits.mask.all()
    assert (hits.error_bound < 1e-13 * hits.t).all()


def test_misses_have_no_bound_and_t_beyond_double_an_infinite_one() -> None:
    vertices, faces = TRIANGLE
    hits = wive.Scene(vertices.astype(np.float64), faces).intersect(
        [[0.2, 0.2, 0], [5, 5, 0], [0.2, 0.2, -1e10]], [[0, 0, 1], [0, 0, 1], [0, 0, 1e-310]]
    )
    assert hits.mask.tolist() == [True, False, True]
    assert hits.error_bound[0] < 1e-14
    assert np.isnan(hits.error_bound[1])
    assert hits.t[2] == np.inf and hits.error_bound[2] == np.inf


@pytest.mark.parametrize("name", CPU)
def test_every_backend_has_the_same_bounds_and_origins(name: str) -> None:
    for accuracy in ACCURACIES:
        vertices, faces, origins, directions = SETS[0](np.float64)
        hits, expected = (
            wive.Scene(vertices, faces, backend=backend, accuracy=accuracy).intersect(origins, directions)
            for backend in (name, "scalar")
        )
        np.testing.assert_array_equal(hits.error_bound, expected.error_bound)
        np.testing.assert_array_equal(hits.spawn(-directions), expected.spawn(-directions))


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("shape", SHAPES)
def test_spawned_rays_never_hit_their_own_triangle(shape: tuple[float, float, float], accuracy: str) -> None:
    for slope in (1.0, 1e-4):
        scene, hits, incoming = hits_of(triangles(*shape), accuracy, slope, dtype=np.float64)
        assert hits.mask.mean() > 0.9
        assert hits.spawn([0, 0, 1]).dtype == np.float64
        assert own_hits(scene, hits, incoming, flattest=1e-17) == 0


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_points_not_moved_do_hit_again_so_these_rays_can_tell(accuracy: str) -> None:
    scene, hits, incoming = hits_of(triangles(1.0, 1.0, 1.0), accuracy, dtype=np.float64)
    assert own_hits(scene, hits, incoming, spawn=lambda _: hits.points()) > len(hits)


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_next_double_alone_is_not_far_enough(accuracy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    no_offset = spawn.Rounding(*[0.0] * 8)
    monkeypatch.setitem(spawn.ROUNDINGS, "float64", no_offset)
    scene, hits, incoming = hits_of(triangles(1.0, 1.0, 1.0), accuracy, dtype=np.float64)
    assert own_hits(scene, hits, incoming) > 0


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("shape", SHAPES[::2])
def test_origins_lie_strictly_on_the_side_of_the_direction(
    shape: tuple[float, float, float], accuracy: str
) -> None:
    _, hits, incoming = hits_of(triangles(*shape), accuracy, dtype=np.float64)
    assert_origins_on_the_side(hits, ways_out(hits, incoming)[:3])


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_origins_move_by_less_than_a_millionth_of_what_float32_needs(accuracy: str) -> None:
    vertices, faces = survey(2)
    directions = np.random.default_rng(4).standard_normal((2000, 3))
    hits = wive.Scene(vertices, faces, accuracy=accuracy).intersect(UTM, directions)
    moved = np.linalg.norm(hits.spawn(-directions) - hits.points(), axis=1)
    assert hits.mask.all()
    assert (moved < 64 * np.spacing(UTM.max())).all()
    vertices -= UTM
    hits = wive.Scene(vertices, faces, accuracy=accuracy).intersect([0, 0, 0], directions)
    moved = np.linalg.norm(hits.spawn(-directions) - hits.points(), axis=1)
    assert (moved < 1e-12).all()


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_a_closed_body_at_survey_coordinates_is_not_left_from_inside(accuracy: str) -> None:
    outwards, inwards = leave(wive.Scene(*survey(3), accuracy=accuracy), UTM, seed=7)
    assert not outwards.any() or accuracy == "fast"
    assert inwards.all() or accuracy == "fast"


def test_sides_are_right_for_directions_of_any_length() -> None:
    vertices, faces = TRIANGLE
    scene = wive.Scene(1e15 * vertices.astype(np.float64), faces)
    hits = scene.intersect([[2e14, 2e14, 0]], [[0, 0, 1]])
    above, below = hits.spawn([0, 0, 1.0]), hits.spawn([0, 0, -1.0])
    for length in (1e-320, 1e-200, 1e200, 1.7e308):
        np.testing.assert_array_equal(hits.spawn([length, -length, length]), above)
        np.testing.assert_array_equal(hits.spawn([-length, length, -length]), below)
    for nonsense in ([0, 0, np.inf], [np.inf, -np.inf, 0], [np.nan, 0, 0], [0, 0, 0]):
        assert not scene.occluded(hits.spawn(nonsense), nonsense).any()
    assert np.isnan(scene.intersect([[-1.0, 0, 0]], [[0, 0, 1.0]]).spawn([0, 0, 1.0])).all()


def test_triangles_too_small_for_double_to_judge_give_no_wrong_answer_and_no_warning() -> None:
    vertices, faces = TRIANGLE
    for scale in (1e-90, 1e-140):
        scene = wive.Scene(scale * vertices.astype(np.float64), faces)
        hits = scene.intersect(np.array([[0.2, 0.2, 0]]) * scale, [[0, 0, 1.0]])
        bound, origins = hits.error_bound, hits.spawn([0, 0, 1.0])
        assert not hits.mask[0] or bound[0] == np.inf or abs(hits.t[0] - scale) <= bound[0]
        assert not scene.occluded(origins, [0, 0, 1.0]).any()
