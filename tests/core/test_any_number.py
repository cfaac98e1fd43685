"""Scenes of any number of triangles, and batches of any number of rays of which some can't hit."""

from typing import Literal

import numpy as np
import pytest
from support.meshes import sphere

import wive

Nodes = Literal["float32", "compressed"]
KINDS = [
    (np.float32, "float32"),
    (np.float32, "compressed"),
    (np.float64, "float32"),
    (np.float64, "compressed"),
]
TRIANGLES = [*range(36), *(2**k + d for k in range(6, 13) for d in (-1, 0, 1))]
RAYS = [*range(1, 36), 63, 64, 65, 100, 257, 5000]
LEAST, MOST = -np.inf, np.inf
# What turns a ray into one that can't hit: a new origin, direction, or interval.
NO_RAYS = [
    ("origin", [np.nan, 0.1, 0.2]), ("origin", [0.1, MOST, 0.2]), ("origin", [0.1, 0.2, LEAST]),
    ("origin", [0, 2e18, 0]), ("direction", [0, -0.0, 0]), ("direction", [1, np.nan, 1]),
    ("direction", [MOST, 0.1, 0.2]), ("direction", [LEAST] * 3), ("interval", [MOST, 0]),
    ("interval", [np.nan, MOST]), ("interval", [0, np.nan]), ("interval", [np.nan] * 2),
    ("interval", [LEAST, LEAST]), ("interval", [MOST, MOST]), ("interval", [2, 1]),
]  # fmt: skip


@pytest.mark.parametrize(("dtype", "nodes"), KINDS)
def test_each_of_any_number_of_triangles_is_hit(cpu_backend: str, dtype: type, nodes: Nodes) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for count in TRIANGLES:
        places = np.stack([2 * np.arange(count) % 64, 2 * np.arange(count) // 64, np.zeros(count)], axis=1)
        vertices = (places[:, None] + corners).reshape(-1, 3).astype(dtype)
        faces = np.arange(3 * count).reshape(-1, 3)
        scene = wive.Scene(vertices, faces, backend=cpu_backend, nodes=nodes)
        assert len(scene) == count
        origins = (places + np.array([0.25, 0.25, 1])).astype(dtype)
        np.testing.assert_array_equal(scene.intersect(origins, [0, 0, -1]).prim, np.arange(count))
        assert (scene.count(origins, [0, 0, -1]) == 1).all()
        assert not scene.occluded(origins + dtype(0.5), [0, 0, -1]).any()


@pytest.mark.parametrize(("dtype", "nodes"), KINDS)
@pytest.mark.parametrize("accuracy", ["fast", "watertight", "exact"])
def test_rays_that_can_not_hit_change_no_other_ray(
    cpu_backend: str, accuracy: Literal["fast", "watertight", "exact"], dtype: type, nodes: Nodes
) -> None:
    if accuracy == "exact" and dtype is np.float64:
        pytest.skip("exact takes float32 numbers only")
    vertices, faces = sphere(3)
    scene = wive.Scene(vertices.astype(dtype), faces, backend=cpu_backend, accuracy=accuracy, nodes=nodes)
    random = np.random.default_rng(1)
    for count in RAYS:
        rays = {
            "origin": random.uniform(-0.5, 0.5, (count, 3)).astype(dtype),
            "direction": random.standard_normal((count, 3)).astype(dtype),
            "interval": np.tile(np.array([0, MOST], dtype), (count, 1)),
        }
        expected = scene.intersect(rays["origin"], rays["direction"])
        can = random.integers(2, size=count).astype(bool)
        for i in np.flatnonzero(~can):
            part, value = NO_RAYS[random.integers(len(NO_RAYS))]
            rays[part][i] = value
        batch = rays["origin"], rays["direction"], *rays["interval"].T
        assert expected.mask.all()
        for in_flight in (None, 1):
            hits = scene.intersect(*batch, in_flight=in_flight)
            np.testing.assert_array_equal(hits.prim, np.where(can, expected.prim, -1))
            np.testing.assert_array_equal(hits.t, np.where(can, expected.t, MOST))
            np.testing.assert_array_equal(scene.occluded(*batch, in_flight=in_flight), can)
            np.testing.assert_array_equal(scene.count(*batch, in_flight=in_flight), can)
