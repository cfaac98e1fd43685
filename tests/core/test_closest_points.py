"""Closest points: the same bits whatever computes them, and against brute force on meshes of some size."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from support.meshes import soup, sphere

import wive

Mesh = tuple[np.ndarray, np.ndarray]


def brute_force(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) distances in float64, from every point to every triangle."""
    a, b, c = vertices.astype(np.float64)[faces].swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    area = (normal**2).sum(axis=1)
    a, b, c, normal, area = (x[area > 0] for x in (a, b, c, normal, area))
    answer = []
    for p in points.astype(np.float64):
        squares = []
        inside = area > 0
        for one, other in ((a, b), (b, c), (c, a)):
            side, to = other - one, p - one
            along = np.clip((to * side).sum(axis=1) / (side**2).sum(axis=1), 0, 1)
            squares.append(((to - along[:, None] * side) ** 2).sum(axis=1))
            inside &= (normal * np.cross(side, to)).sum(axis=1) > 0
        squares.append(np.where(inside, (normal * (p - a)).sum(axis=1) ** 2 / area, np.inf))
        answer.append(np.sqrt(np.min(squares)))
    return np.array(answer)


def mixed_points(random: np.random.Generator, mesh: Mesh, count: int) -> np.ndarray:
    """Around the mesh, on it, beside it, and far away."""
    vertices, faces = mesh
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    corners = vertices[faces[random.integers(len(faces), size=count)]].astype(np.float64)
    surface = (corners * random.dirichlet((1, 1, 1), count)[..., None]).sum(axis=1)
    kinds = [
        low + (high - low) * random.uniform(-0.5, 1.5, (count, 3)),
        surface,
        surface + 1e-3 * (high - low) * random.standard_normal((count, 3)),
        corners[:, 0],
        1e6 * (high - low).max() * random.standard_normal((count, 3)),
    ]
    return np.concatenate(kinds)


@pytest.fixture(scope="module")
def ball() -> Mesh:
    return sphere(4)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("accuracy", ["watertight", "fast"])
def test_distances_are_those_of_brute_force(ball: Mesh, accuracy: str, dtype: type) -> None:
    for mesh in (ball, soup(3000, 4, 0.05)):
        vertices, faces = mesh[0].astype(dtype), mesh[1]
        points = mixed_points(np.random.default_rng(5), mesh, 20).astype(dtype)
        found = wive.Scene(vertices, faces, accuracy=accuracy).closest(points)
        expected = brute_force(vertices, faces, points)
        error = 2.0**-24 if accuracy == "fast" and dtype == np.float32 else 2.0**-45
        np.testing.assert_allclose(found.distance, expected, rtol=np.finfo(dtype).eps, atol=4 * error)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("accuracy", ["watertight", "fast"])
def test_bits_depend_on_nothing_but_mesh_and_point(
    ball: Mesh, backend: str, accuracy: str, dtype: type
) -> None:
    random = np.random.default_rng(7)
    for mesh in (ball, soup(2000, 9)):
        vertices, faces = mesh[0].astype(dtype), mesh[1]
        points = mixed_points(random, mesh, 200).astype(dtype)
        first = wive.Scene(vertices, faces, accuracy=accuracy, backend="scalar").closest(points, threads=1)
        for found, rows in variants(vertices, faces, points, accuracy, backend, random):
            np.testing.assert_array_equal(found.distance, first.distance[rows])
            np.testing.assert_array_equal(found.prim, first.prim[rows])
            np.testing.assert_array_equal(found.uv, first.uv[rows])


def variants(
    vertices: np.ndarray,
    faces: np.ndarray,
    points: np.ndarray,
    accuracy: str,
    backend: str,
    random: np.random.Generator,
) -> Iterator[tuple[wive.Closest, np.ndarray]]:
    threads: list[int | None] = [None] if backend == "warp" else [1, 2]
    for nodes in ("float32", "compressed"):
        for quality in ("medium",) if backend == "warp" else ("medium", "high"):
            options = {"accuracy": accuracy, "nodes": nodes, "quality": quality, "backend": backend}
            scene = wive.Scene(vertices, faces, **options)
            for count in threads:
                rows = random.permutation(len(points))
                yield scene.closest(points[rows], threads=count), rows
            for one in random.integers(len(points), size=5):
                yield scene.closest(points[one][None]), np.array([one])


def test_exact_scenes_have_the_bits_of_watertight_ones(ball: Mesh, backend: str) -> None:
    points = mixed_points(np.random.default_rng(3), ball, 100).astype(np.float32)
    found = [
        wive.Scene(*ball, accuracy=name, backend=backend).closest(points) for name in ("exact", "watertight")
    ]
    for name in ("distance", "prim", "uv"):
        np.testing.assert_array_equal(*(getattr(one, name) for one in found))


def test_a_largest_distance_leaves_out_what_is_farther_and_nothing_else(ball: Mesh, backend: str) -> None:
    points = mixed_points(np.random.default_rng(8), ball, 200)
    for dtype in (np.float32, np.float64):
        scene = wive.Scene(ball[0].astype(dtype), ball[1], backend=backend)
        every = scene.closest(points.astype(dtype))
        for most in (every.distance, np.nextafter(every.distance, dtype(0)), dtype(0.1), dtype(0)):
            some = scene.closest(points.astype(dtype), most)
            inside = every.distance <= most
            np.testing.assert_array_equal(some.distance, np.where(inside, every.distance, np.inf))
            np.testing.assert_array_equal(some.prim, np.where(inside, every.prim, -1))
            np.testing.assert_array_equal(np.isnan(some.uv).all(axis=1), ~inside)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_that_are_no_numbers_or_out_of_range_are_close_to_nothing(backend: str, dtype: type) -> None:
    scene = wive.Scene(sphere(1)[0].astype(dtype), sphere(1)[1], backend=backend)
    bad = np.array([[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf], [1.1e18, 0, 0]], dtype)
    points = np.concatenate([bad, np.zeros((20, 3), dtype), bad])
    found = scene.closest(points)
    assert np.isinf(found.distance[[*range(4), *range(24, 28)]]).all()
    assert (found.prim[[*range(4), *range(24, 28)]] == -1).all()
    assert (found.prim[4:24] >= 0).all()


@pytest.mark.parametrize("scale", [1e-38, 1e-30, 1e-6, 1e6, 1e17])
def test_meshes_of_every_size_have_the_same_answers(backend: str, scale: float) -> None:
    power = np.float32(2.0 ** round(np.log2(scale)))
    vertices, faces = sphere(2)
    points = mixed_points(np.random.default_rng(1), (vertices, faces), 50)[:200].astype(np.float32)
    kept = (abs(points * power) <= 1e18).all(axis=1)
    one = wive.Scene(vertices.astype(np.float64), faces, backend=backend).closest(points[kept])
    other = wive.Scene(vertices.astype(np.float64) * power, faces, backend=backend).closest(
        points[kept].astype(np.float64) * power
    )
    np.testing.assert_array_equal(one.prim, other.prim)
    np.testing.assert_array_equal(one.uv, other.uv)
    np.testing.assert_array_equal(one.distance * power, other.distance)


def test_an_empty_scene_is_close_to_nothing(backend: str) -> None:
    scene = wive.Scene(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), backend=backend)
    assert scene.closest(np.zeros((3, 3))).prim.tolist() == [-1, -1, -1]
    assert len(scene.closest(np.zeros((0, 3)))) == 0


def test_large_scenes_agree_between_backends(scenes: Callable[[str], Mesh], cpu_backend: str) -> None:
    mesh = scenes("living_room")
    points = mixed_points(np.random.default_rng(2), mesh, 1000).astype(np.float32)
    first = wive.Scene(*mesh, backend="scalar").closest(points)
    found = wive.Scene(*mesh, backend=cpu_backend, nodes="compressed").closest(points)
    np.testing.assert_array_equal(found.distance, first.distance)
    np.testing.assert_array_equal(found.prim, first.prim)
    np.testing.assert_array_equal(found.uv, first.uv)
    np.testing.assert_allclose(
        found.distance[::900], brute_force(*mesh, points[::900]), rtol=2.0**-23, atol=2.0**-40
    )


def test_after_a_refit_closest_points_are_those_of_the_new_positions(backend: str) -> None:
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces, backend=backend)
    points = np.random.default_rng(1).standard_normal((100, 3)).astype(np.float32)
    scene.refit(vertices * np.float32([1, 2, 3]))
    fresh = wive.Scene(vertices * np.float32([1, 2, 3]), faces, backend=backend)
    np.testing.assert_array_equal(scene.closest(points).distance, fresh.closest(points).distance)
    np.testing.assert_array_equal(scene.closest(points).prim, fresh.closest(points).prim)
