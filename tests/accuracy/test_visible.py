"""`Scene.visible` is right for points in space and on surfaces, by fractions and by known shapes."""

import functools

import numpy as np
import pytest
from support.meshes import TRIANGLE, soup, sphere
from support.sight import UTM, error_of, free, places, wall
from support.spawned_rays import EXPONENTS, SLIVERS, TRANSLATED, triangles

import wive
from wive._internal import segments

ACCURACIES = ("fast", "watertight", "exact")
SCENES = [("fast", np.float32), ("watertight", np.float32), ("exact", np.float32),
          ("fast", np.float64), ("watertight", np.float64)]  # fmt: skip


@functools.cache
def segments_in_space(dtype: type) -> tuple[np.ndarray, ...]:
    """Vertices, faces, both ends, and whether the segments are free."""
    vertices, faces = soup(12, seed=1, size=0.6, dtype=dtype)
    a, b = np.random.default_rng(2).uniform(-0.2, 1.2, (2, 60, 3)).astype(dtype)
    return vertices, faces, a, b, free(vertices, faces, a, b, error_of(dtype))


@pytest.mark.parametrize(("accuracy", "dtype"), SCENES)
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_segments_between_points_in_space_are_free_as_fractions_say(
    accuracy: str, dtype: type, nodes: str, backend: str
) -> None:
    vertices, faces, a, b, expected = segments_in_space(dtype)
    scene = wive.Scene(vertices, faces, accuracy=accuracy, nodes=nodes, backend=backend)
    assert 10 < expected.sum() < 50
    np.testing.assert_array_equal(scene.visible(a, b), expected)


@pytest.mark.parametrize(("accuracy", "dtype"), SCENES)
@pytest.mark.parametrize("place", [np.zeros(3), UTM])
def test_segments_between_points_on_surfaces_are_free_as_fractions_say(
    accuracy: str, dtype: type, place: np.ndarray
) -> None:
    vertices, faces = soup(10, seed=3, size=0.7, dtype=dtype)
    vertices = (vertices * 40 + place).astype(dtype)
    scene = wive.Scene(vertices, faces, accuracy=accuracy)
    corners = vertices[faces].astype(np.float64)
    random = np.random.default_rng(4)
    found = []
    for name, points in places(corners[random.integers(len(faces), size=15)], dtype, seed=5).items():
        others = places(corners[random.integers(len(faces), size=15)], dtype, seed=6)["sampled"]
        expected = free(vertices, faces, points, others, error_of(dtype))
        np.testing.assert_array_equal(scene.visible(points, others), expected, name)
        found += expected.tolist()
    assert 0.2 < np.mean(found) < 0.8


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("shape", EXPONENTS[::3] + TRANSLATED + SLIVERS)
def test_a_triangle_never_hides_the_points_on_it(shape: tuple[float, float, float], accuracy: str) -> None:
    """Whatever the direction, however flat: seen from the side, from the other side, along the edges."""
    corners = triangles(*shape)
    random = np.random.default_rng(7)
    size = abs(corners - corners[:, :1]).max(axis=(1, 2))[:, None]
    flat = np.einsum("nk,nkx->nx", random.standard_normal((len(corners), 3)), corners - corners[:, :1])
    away = np.where(random.random((len(corners), 1)) < 0.5, flat, size * random.standard_normal(flat.shape))
    away += size * 10 ** random.uniform(-9, 1, size.shape) * random.standard_normal(flat.shape)
    for scene_dtype, dtype in ((np.float32, np.float32), (np.float64, np.float64), (np.float64, np.float32)):
        if accuracy == "exact" and scene_dtype is np.float64:
            continue
        rounded = corners.astype(scene_dtype)
        found = places(rounded.astype(np.float64), dtype, seed=8)
        for row in range(0, len(corners), 20):
            scene = wive.Scene(rounded[row], [[0, 1, 2]], accuracy=accuracy)
            for way, points in found.items():
                assert scene.visible(points[row], (points[row] + away[row]).astype(dtype)).all(), way


def test_without_that_bound_triangles_hide_their_points(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segments, "POINT_ROUNDINGS", 0)
    vertices, faces = sphere(2)
    centres = (vertices + np.float32(100))[faces].mean(axis=1)
    seen = wive.Scene(vertices + np.float32(100), faces).visible(centres, 3 * (centres - 100) + 100)
    assert 0.1 < 1 - seen.mean() < 0.9


@pytest.mark.parametrize(("accuracy", "dtype"), SCENES)
@pytest.mark.parametrize("place", [np.zeros(3), UTM])
def test_from_outside_a_convex_body_the_facets_that_face_the_viewer_are_seen(
    accuracy: str, dtype: type, place: np.ndarray, backend: str
) -> None:
    vertices, faces = sphere(2)
    vertices = (vertices.astype(np.float64) * 1000 + place).astype(dtype)
    corners = vertices[faces].astype(np.float64)
    viewer = (place + np.array([2000, 500, -700])).astype(dtype)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    towards = (normals * (viewer.astype(np.float64) - corners[:, 0])).sum(axis=1)
    clear = abs(towards) > 1e-3 * np.linalg.norm(normals, axis=1) * 2000
    scene = wive.Scene(vertices, faces, accuracy=accuracy, backend=backend)
    assert clear.mean() > 0.98
    np.testing.assert_array_equal(
        scene.visible(viewer, corners.mean(axis=1).astype(dtype))[clear], towards[clear] > 0
    )
    if dtype is np.float64 or not place.any():  # else rounding moves some points round an edge
        for name, points in places(corners, dtype, seed=9).items():
            if name.startswith("sampled"):
                np.testing.assert_array_equal(scene.visible(viewer, points)[clear], towards[clear] > 0, name)
    # and through the body, whose surface has no inside, every point sees every other
    points = places(corners, dtype, seed=10)["sampled"]
    assert scene.visible(points, points[::-1]).all()


def test_points_in_a_torus_see_each_other_if_the_chord_stays_inside() -> None:
    sides = np.arange(96) * 2 * np.pi / 96
    around, across = (angle.ravel() for angle in np.meshgrid(sides, sides, indexing="ij"))
    radius = 3 + np.cos(across)
    vertices = np.stack([radius * np.cos(around), radius * np.sin(around), np.sin(across)], axis=1)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(96), np.arange(96), indexing="ij"))
    a, b, c, d = (96 * ((i + p) % 96) + (j + q) % 96 for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    random = np.random.default_rng(11)
    first, turn = random.uniform(-np.pi, np.pi, (2, 5000))
    start, end = (
        np.stack([3 * np.cos(x), 3 * np.sin(x), 0 * x], axis=1).astype(np.float32)
        for x in (first, first + turn)
    )
    nearest = 3 * np.cos(turn / 2)  # of the chord to the axis
    clear = abs(nearest - 2) > 0.02
    scene = wive.Scene(vertices.astype(np.float32), faces)
    seen = scene.visible(start, end)
    np.testing.assert_array_equal(seen[clear], nearest[clear] > 2)


@pytest.mark.parametrize(("accuracy", "dtype"), SCENES[1:3] + SCENES[4:])
@pytest.mark.parametrize(("place", "scale"), [(np.zeros(3), 1.0), (np.zeros(3), 1e-6), (UTM, 50.0)])
@pytest.mark.parametrize("normal", [0, 1, 2])
def test_a_wall_hides_all_that_is_behind_it(
    accuracy: str, dtype: type, place: np.ndarray, scale: float, normal: int
) -> None:
    """Through faces, edges and vertices; from points before it and on it; beside it all is seen."""
    vertices, faces = wall(dtype, place, scale, normal)
    scene = wive.Scene(vertices, faces, accuracy=accuracy)
    random = np.random.default_rng(12)
    inner = (abs(vertices - place) < 0.99 * scale).sum(axis=1) == 3
    targets = vertices[inner].astype(np.float64).repeat(40, axis=0)
    targets[::2] += random.uniform(-0.2, 0.2, targets[::2].shape) * scale
    targets[:, normal] = vertices[0, normal]
    away = random.standard_normal(targets.shape)
    away[:, normal] = random.uniform(0.05, 1, len(away))
    before, behind = (targets + away * scale).astype(dtype), (targets - away * scale).astype(dtype)
    assert not scene.visible(before, behind).any()
    on_wall = targets.astype(dtype)
    assert scene.visible(before, on_wall).all() and scene.visible(on_wall, behind).all()
    beside = np.roll([0, 0, 3 * scale], normal)  # along another axis than the normal
    assert scene.visible((before + beside).astype(dtype), (behind + beside).astype(dtype)).all()


@pytest.mark.parametrize("accuracy", ["watertight", "exact"])
@pytest.mark.parametrize("slope", [(0, 0), (1, 2)])
def test_points_of_one_flat_floor_see_each_other(slope: tuple[int, int], accuracy: str) -> None:
    steps = np.arange(24) * 8
    x, y = (axis.ravel() for axis in np.meshgrid(steps, steps, indexing="ij"))
    vertices = np.stack([x, y, slope[0] * x + slope[1] * y], axis=1) + UTM.round()
    corner = (np.arange(23)[:, None] * 24 + np.arange(23)).ravel()
    a, b, c, d = corner, corner + 24, corner + 25, corner + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    scene = wive.Scene(vertices.astype(np.float32), faces, accuracy=accuracy)
    random = np.random.default_rng(13)
    corners = vertices[faces[random.integers(len(faces), size=3000)]]
    for points in places(corners, np.float32, seed=14).values():
        assert scene.visible(points, points[::-1]).all()
        assert scene.visible(points, (points + np.array([3, -5, 700])).astype(np.float32)).all()
    assert scene.visible(vertices, vertices[::-1]).all()


@pytest.mark.parametrize(("accuracy", "dtype"), SCENES)
def test_hit_points_are_seen_by_the_rays_that_hit_them(accuracy: str, dtype: type) -> None:
    vertices, faces = soup(3000, seed=15, dtype=dtype)
    random = np.random.default_rng(16)
    origins = random.uniform(-0.5, 1.5, (4000, 3)).astype(dtype)
    scene = wive.Scene(vertices, faces, accuracy=accuracy)
    hits = scene.intersect(origins, (random.random((4000, 3)) - origins).astype(dtype))
    found = hits.mask & (hits.error_bound < 1e-4)
    for points in (hits.points(), hits.points().astype(dtype), (hits.points()).astype(np.float32)):
        seen = scene.visible(origins[found], points[found])
        # rays are aimed anew: rounded, few of them pass another triangle's edge on another side
        assert found.sum() > 2000 and (~seen).sum() <= (3 if accuracy != "fast" else 20)


def test_a_point_behind_a_needles_width_of_wall_is_hidden() -> None:
    """The distance that counts as rounding is that of the coordinates, however large the triangle is."""
    vertices, faces = wall(np.float32, np.zeros(3), 1.0)
    scene = wive.Scene(vertices, faces)
    for distance in (1e-3, 1e-7, 1e-12, 1e-30):
        assert not scene.visible([[-distance, 0.1, 0.2]], [[distance, 0.1, 0.2]]).any()
        assert not scene.visible([[-distance, 0.1, 0.2]], [[1, 0.1, 0.3]]).any()
    moved = wive.Scene(vertices + np.float32(1), faces)
    for distance, is_seen in ((1e-3, False), (1e-6, False), (2e-7, True)):
        assert moved.visible([[1 - distance, 1.1, 1.2]], [[1 + distance, 1.1, 1.2]]) == is_seen
    in_double = wive.Scene((vertices + 1).astype(np.float64), faces)
    assert not in_double.visible([[1 - 1e-14, 1.1, 1.2]], [[1 + 1e-14, 1.1, 1.2]]).any()


@pytest.mark.parametrize(("accuracy", "dtype"), SCENES)
def test_the_answer_is_that_of_the_reverse(accuracy: str, dtype: type) -> None:
    vertices, faces = soup(400, seed=17, dtype=dtype)
    random = np.random.default_rng(18)
    points = random.permutation(np.concatenate([vertices, vertices[faces].mean(axis=1)]))
    scene = wive.Scene(vertices, faces, accuracy=accuracy)
    a, b = points[:600], points[600:1200]
    seen = scene.visible(a, b)
    assert 0 < seen.sum() < 600
    np.testing.assert_array_equal(scene.visible(b, a), seen)
    np.testing.assert_array_equal(scene.visible(a, b, threads=1), seen)


def test_far_ends_are_seen_as_near_ones_in_the_same_direction() -> None:
    vertices, faces = sphere(3)
    scene = wive.Scene(vertices, faces)
    centres = vertices[faces].astype(np.float64).mean(axis=1)
    sun = np.array([0.3, 0.5, 0.8])
    near = scene.visible(centres, 1e3 * sun)
    assert 0.4 < near.mean() < 0.6
    for distance in (1e6, 1e9, 1e15):
        assert (scene.visible(centres, distance * sun) != near).sum() <= 4  # facets seen edge-on
    assert not scene.visible([-1e9 * sun], [1e9 * sun]).any()


def test_a_point_sees_itself_and_its_neighbours() -> None:
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces)
    assert scene.visible(vertices, vertices).all()
    assert scene.visible([[0, 0, 0]], [[0, 0, 0]]).all()
    for towards in (-np.inf, np.inf):
        assert scene.visible(vertices, np.nextafter(vertices, np.float32(towards))).all()
    assert scene.visible([[0, 0, 0]], [[1e-45, -1e-40, 1e-310]]).all()


def test_a_point_that_is_no_point_is_seen_by_none() -> None:
    scene = wive.Scene(*TRIANGLE)
    bad = [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf], [2e18, 0, 0], [0, 0, 0]]
    for kind in (np.float32, np.float64, list):
        rows = bad if kind is list else np.array(bad, kind)
        assert scene.visible(rows, [5, 5, 5]).tolist() == [False, False, False, False, True]
        assert scene.visible([5, 5, 5], rows).tolist() == [False, False, False, False, True]
        assert not scene.visible(rows[:4], rows[:4]).any()
    masked = np.ma.masked_array(np.zeros((2, 3)), [[False, True, False], [False, False, False]])
    assert scene.visible(masked, [5, 5, 5]).tolist() == [False, True]


def test_degenerate_and_absent_triangles_hide_nothing() -> None:
    line = wive.Scene([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2], [0, 0, 1]])
    assert line.visible([[1, -1, 0]], [[1, 1, 0]]).all()
    nothing = wive.Scene(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
    assert nothing.visible([[0, 0, 0], [1, np.nan, 0]], [1, 1, 1]).tolist() == [True, False]


@pytest.mark.parametrize("scale", [1e-44, 1e-30, 1e15])
def test_walls_of_any_size_hide(scale: float) -> None:
    for dtype in (np.float32, np.float64):
        vertices, faces = wall(dtype, np.zeros(3), 64 * scale)
        scene = wive.Scene(vertices, faces)
        a = np.array([[-64, 7, 9], [-33, 1, 2]], np.float64) * scale
        assert not scene.visible(a, a * [-1, 1, 1]).any()
        assert scene.visible(a, a * [0, 1, 1]).all()
    tiny, faces = wall(np.float64, np.zeros(3), 1e-100)
    assert not wive.Scene(tiny, faces).visible([[-1e-100, 2e-101, 3e-101]], [[1e-100, 2e-101, 3e-101]]).any()
