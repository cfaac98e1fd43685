"""Closest points against exact rationals: the bound on the distance, ties, and what is never chosen."""

import functools
from fractions import Fraction

import numpy as np
import pytest
from support.closed_meshes import grid
from support.closest_oracle import error_bounds, root, squared_distances
from support.hard_sets import few_bits, separate
from support.meshes import soup, sphere

import wive

COUNT = 48


def on_the_surface(random: np.random.Generator, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Corners, points of edges and of insides, rounded to float32, and points close to these."""
    corners = vertices[faces[random.integers(len(faces), size=COUNT // 4)]].astype(np.float64)
    weights = random.dirichlet((1, 1, 1), len(corners))
    inner = (corners * weights[..., None]).sum(axis=1)
    edge = (corners[:, 0] + 3 * corners[:, 1]) / 4
    near = inner + 1e-5 * random.standard_normal(inner.shape)
    return np.concatenate([corners[:, 0], edge, inner, near]).astype(np.float32)


@functools.cache
def sets() -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    random = np.random.default_rng(16)
    ball, ball_faces = sphere(1)
    some, some_faces = soup(40, 5)
    around = random.uniform(-2, 2, (COUNT, 3)).astype(np.float32)
    caps = soup(40, 7)[0].reshape(-1, 3, 3)
    caps[:, 2] = (caps[:, 0] + caps[:, 1]) / 2 + random.standard_normal((40, 3)) * 10.0 ** -random.uniform(
        3, 7, (40, 1)
    )
    needles = soup(40, 8)[0].reshape(-1, 3, 3)
    needles[:, 2] = needles[:, 1] + random.standard_normal((40, 3)) * 10.0 ** -random.uniform(3, 6, (40, 1))
    integers = few_bits(random, 40, 3), random.integers(40, size=(40, 3)).astype(np.int32)
    place = np.array([148376, 1234, -223423], np.float32)
    return {
        "sphere": (ball, ball_faces, around),
        "on the sphere": (ball, ball_faces, on_the_surface(random, ball, ball_faces)),
        "soup": (some, some_faces, around),
        "on the soup": (some, some_faces, on_the_surface(random, some, some_faces)),
        "caps": (caps.reshape(-1, 3), separate(40), around),
        "on the caps": (
            caps.reshape(-1, 3),
            separate(40),
            on_the_surface(random, caps.reshape(-1, 3), separate(40)),
        ),
        "needles": (needles.reshape(-1, 3), separate(40), around),
        "small integers": (*integers, few_bits(random, COUNT, 5)),
        "in UTM coordinates": (ball * 50 + place, ball_faces, around * 60 + place),
        "caps from far away": (caps.reshape(-1, 3), separate(40), around * np.float32(1e5)),
        "far away": (ball, ball_faces, around * np.float32(1e6)),
        "tiny": (ball * np.float32(1e-12), ball_faces, around * np.float32(1e-12)),
        "huge": (ball * np.float32(1e15), ball_faces, around * np.float32(1e15)),
    }


NAMES = tuple(sets())


@functools.cache
def truth(name: str) -> np.ndarray:
    return squared_distances(*sets()[name])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", NAMES)
def test_the_distance_is_within_its_bound_of_the_exact_one(name: str, dtype: type) -> None:
    vertices, faces, points = sets()[name]
    vertices, points = vertices.astype(dtype), points.astype(dtype)
    closest = wive.Scene(vertices, faces).closest(points)
    bounds = error_bounds(vertices, faces, closest.distance, closest.prim)
    ulp = np.spacing(closest.distance).astype(np.float64)
    for i, (row, found) in enumerate(zip(truth(name), closest.distance.tolist(), strict=True)):
        exact = root(min(square for square in row if square is not None))
        assert abs(Fraction(found) - exact) <= Fraction(0.5001 * ulp[i]) + Fraction(bounds[i]), i
        # and the triangle that is named is as close as that
        assert root(row[closest.prim[i]]) - exact <= Fraction(bounds[i]) * 2, i


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", NAMES)
def test_uv_is_the_closest_point(name: str, dtype: type) -> None:
    vertices, faces, points = sets()[name]
    vertices, points = vertices.astype(dtype), points.astype(dtype)
    closest = wive.Scene(vertices, faces).closest(points)
    assert (closest.uv >= 0).all() and (closest.uv.sum(axis=1) <= 1 + 2 * np.finfo(dtype).eps).all()
    way = np.linalg.norm(closest.points() - points.astype(np.float64), axis=1)
    size = np.abs(vertices).max() + np.abs(points).max()
    assert (abs(way - closest.distance) <= 4 * np.finfo(dtype).eps * size).all()


def test_a_point_beside_a_shared_edge_or_corner_gets_the_lowest_triangle_there(backend: str) -> None:
    vertices, faces = grid(2)
    random = np.random.default_rng(1)
    faces = faces[random.permutation(len(faces))]
    for place in ((0, 0, 0), (0.1, -7.3, 1e3)):
        moved = ((vertices - 1) * 0.37 + np.array(place)).astype(np.float32)
        corners = moved[faces]
        ends, middle = corners.reshape(-1, 3), corners.astype(np.float64).mean(axis=(0, 1))
        edges = ((corners + np.roll(corners, -1, axis=1)) / 2).reshape(-1, 3)
        # away from the middle of the box, the nearest point of the surface stays what it was on sides' edges
        points = np.concatenate([ends + 8 * (ends - middle), edges]).astype(np.float32)
        squares = squared_distances(moved, faces, points[::11])
        found = wive.Scene(moved, faces, backend=backend).closest(points[::11])
        tied = 0
        for row, prim in zip(squares, found.prim, strict=True):
            least = min(row)
            nearest = [square == least for square in row]
            if nearest.count(True) > 1 and sum(square <= least * (1 + 2**-30) for square in row) == sum(
                nearest
            ):
                assert prim == nearest.index(True)
                tied += 1
        assert tied > 12


def test_of_coincident_triangles_the_lowest_is_chosen(backend: str) -> None:
    vertices, faces = soup(50, 3)
    doubled = np.concatenate([faces, faces[:, [1, 2, 0]], faces[:, [0, 2, 1]]])
    points = np.random.default_rng(2).uniform(-1, 2, (2000, 3)).astype(np.float32)
    for dtype in (np.float32, np.float64):
        found = wive.Scene(vertices.astype(dtype), doubled, backend=backend).closest(points)
        on_edges = (found.uv == 0).any(axis=1) | (found.uv.sum(axis=1) == 1)
        assert (found.prim[on_edges] < 50).all() and np.count_nonzero(on_edges) > 500
        copies = np.array([*range(50), *range(50), *range(50)])
        np.testing.assert_array_equal(
            wive.Scene(vertices.astype(dtype), faces).closest(points).prim, copies[found.prim]
        )


def test_triangles_without_an_area_are_never_chosen(backend: str) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9], [5, 5, 5], [7, 7, 7]], np.float32)
    faces = np.array([[3, 3, 3], [3, 4, 5], [0, 1, 2]], np.int32)
    found = wive.Scene(vertices, faces, backend=backend).closest(np.array([[9, 9, 9]], np.float32))
    assert found.prim.tolist() == [2]
    none = wive.Scene(vertices, faces[:2], backend=backend).closest([[9, 9, 9]])
    assert none.prim.tolist() == [-1] and none.distance.tolist() == [np.inf] and np.isnan(none.uv).all()


def test_a_point_of_an_upright_face_is_at_distance_zero() -> None:
    vertices, faces = grid(3)
    random = np.random.default_rng(6)
    points = (random.random((300, 3)) * 3).astype(np.float32)
    points[np.arange(300), random.integers(3, size=300)] = random.integers(2, size=300) * 3
    assert (wive.Scene(vertices, faces).closest(points).distance == 0).all()
