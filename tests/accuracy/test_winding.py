"""Winding numbers against the sum of every triangle's solid angle."""

from collections.abc import Iterator

import numpy as np
import pytest
from support.meshes import soup, sphere

from wive import _cpu

ERROR = 0.03  # as cpu/build/winding.cpp says


def exact_winding(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) by van Oosterom and Strackee 1983, every triangle alone."""
    a, b, c = (vertices[faces[:, k]][None] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))

    def dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        return (one * other).sum(axis=2)

    below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    return 2 * np.arctan2(dot(a, np.cross(b, c)), below).sum(axis=1) / (4 * np.pi)


def meshes() -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    random = np.random.default_rng(2)
    vertices, faces = sphere(4)
    yield "ball", vertices, faces
    yield "in holes", vertices, np.ascontiguousarray(faces[random.random(len(faces)) < 0.7])
    yield "flat", vertices * np.float32([1, 1, 0.01]), faces
    yield "far from the origin", vertices + np.float32([5000, 0, -300]), faces
    yield "soup", *soup(1500, 5, 0.05)


MESHES = {name: mesh for name, *mesh in meshes()}


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", MESHES)
def test_it_is_the_sum_of_solid_angles(name: str, dtype: type, nodes: str) -> None:
    vertices, faces = MESHES[name]
    vertices = vertices.astype(dtype)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    points = np.random.default_rng(1).uniform(low - 0.3, high + 0.3, (700, 3)).astype(dtype)
    found = _cpu.Bvh(vertices, faces, nodes=nodes).winding(points)
    expected = exact_winding(vertices.astype(np.float64), faces, points.astype(np.float64))
    assert abs(found - expected).max() < ERROR
    assert np.median(abs(found - expected)) < ERROR / 20


@pytest.mark.parametrize("scale", [2.0**-120, 2.0**-30, 2.0**50])
def test_it_does_not_depend_on_the_unit_of_length(scale: float) -> None:
    vertices, faces = sphere(3)
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (300, 3)).astype(np.float32)
    one = _cpu.Bvh(vertices, faces).winding(points)
    other = _cpu.Bvh(vertices * np.float32(scale), faces).winding(points * np.float32(scale))
    np.testing.assert_allclose(one, other, atol=ERROR)


def test_points_that_are_no_numbers_have_none_and_threads_change_nothing() -> None:
    bvh = _cpu.Bvh(*sphere(2))
    points = np.array([[np.nan, 0, 0], [0, 0, np.inf], [0, 0, 0]] * 700, np.float32)
    found = bvh.winding(points, 2)
    assert (
        np.isnan(found[0::3]).all() and np.isnan(found[1::3]).all() and (abs(found[2::3] - 1) < ERROR).all()
    )
    np.testing.assert_array_equal(found, bvh.winding(points, 1))
