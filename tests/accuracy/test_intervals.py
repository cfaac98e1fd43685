"""Intervals are closed, and compared with the t that is returned, in every query, accuracy and precision."""

from typing import Literal

import numpy as np
import pytest
from support.closed_meshes import placed
from support.meshes import random_rays, soup, sphere

import wive

Accuracy = Literal["fast", "watertight", "exact"]
KINDS: list[tuple[Accuracy, type]] = [
    ("fast", np.float32),
    ("watertight", np.float32),
    ("exact", np.float32),
    ("fast", np.float64),
    ("watertight", np.float64),
]


def check_limits_at_hits(
    scene: wive.Scene, origins: np.ndarray, directions: np.ndarray, least: float = 0.3
) -> None:
    """Every query with limits at the t that `intersect` and `intersect_all` return, and just beside them."""
    closest = scene.intersect(origins, directions)
    hit = closest.mask
    assert hit.mean() > least
    origins, directions, t, prim = origins[hit], directions[hit], closest.t[hit], closest.prim[hit]
    below = np.nextafter(t, t.dtype.type(-np.inf))
    assert scene.occluded(origins, directions, tmax=t).all()
    assert scene.occluded(origins, directions, tmin=t).all()
    assert scene.occluded(origins, directions, tmin=t, tmax=t).all()
    assert not scene.occluded(origins, directions, tmax=below)[below >= 0].any()
    for limits in ({"tmax": t}, {"tmin": t}, {"tmin": t, "tmax": t}):
        again = scene.intersect(origins, directions, **limits)
        np.testing.assert_array_equal(again.t, t)
        np.testing.assert_array_equal(again.prim, prim)
    for touching in (False, True):
        totals = scene.count(origins, directions, touching=touching)
        ends = scene.intersect_all(origins, directions, touching=touching)
        last = np.maximum.reduceat(ends.t, ends.offsets[:-1][totals > 0])
        some = totals > 0
        rays = origins[some], directions[some]
        first = ends.t[ends.offsets[:-1][some]]
        np.testing.assert_array_equal(
            scene.count(*rays, tmin=first, tmax=last, touching=touching), totals[some]
        )


@pytest.mark.parametrize(("accuracy", "dtype"), KINDS)
def test_limits_at_a_returned_t_keep_that_hit(cpu_backend: str, accuracy: Accuracy, dtype: type) -> None:
    vertices, faces = soup(60, 51, 0.4)
    scene = wive.Scene(vertices.astype(dtype), faces, backend=cpu_backend, accuracy=accuracy)
    origins, directions = random_rays(1500, 52, 0, 1)
    check_limits_at_hits(scene, origins.astype(dtype), directions.astype(dtype))


@pytest.mark.parametrize(("accuracy", "dtype"), KINDS)
@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("length", [1e-20, 1.0, 1e12])
def test_limits_keep_their_hit_at_every_scale_and_length_of_direction(
    cpu_backend: str, accuracy: Accuracy, dtype: type, scale: float, length: float
) -> None:
    vertices, faces = placed(sphere(2), scale, (0, 0, 0))
    origins, directions = random_rays(400, 53, -0.5, 0.5)
    origins, directions = (origins * scale).astype(dtype), (directions * length).astype(dtype)
    scene = wive.Scene(vertices.astype(dtype), faces, backend=cpu_backend, accuracy=accuracy)
    check_limits_at_hits(scene, origins, directions, 0.99)


@pytest.mark.parametrize(("accuracy", "dtype"), KINDS)
@pytest.mark.parametrize("exponent", [-0.999, -0.97, 0.85, 0.94, 0.999])
def test_limits_keep_their_hit_if_t_under_or_overflows(
    cpu_backend: str, accuracy: Accuracy, dtype: type, exponent: float
) -> None:
    """exponent: that of the directions' length, relative to the dtype's largest."""
    length = 2 ** (exponent * np.log2(np.finfo(dtype).max / 8, dtype=np.float64))
    random = np.random.default_rng(54)
    corners = np.array([[-1, -1, 0], [2, -1, 0], [-1, 2, 0]])
    depths = np.array([1, 1 + 2.0**-20, 1.5, 4])
    vertices = np.concatenate([corners + np.array([0, 0, depth]) for depth in depths]).astype(dtype)
    for scale in (1.0, 2.0 ** (-np.finfo(dtype).maxexp // 4)):
        scene = wive.Scene(
            (vertices * scale).astype(dtype),
            np.arange(12).reshape(4, 3),
            backend=cpu_backend,
            accuracy=accuracy,
        )
        directions = np.append(random.uniform(-0.1, 0.1, (40, 2)), np.ones((40, 1)), axis=1)
        directions = (directions * length * random.uniform(1, 3, (40, 1))).astype(dtype)
        check_limits_at_hits(scene, np.zeros((40, 3), dtype), directions, 0.99)


@pytest.mark.parametrize(("accuracy", "dtype"), [kind for kind in KINDS if kind[0] != "fast"])
def test_a_hit_behind_the_origin_is_not_at_zero(cpu_backend: str, accuracy: Accuracy, dtype: type) -> None:
    """Not even if its t is so small that it rounds to zero; one at the origin is."""
    vertices = np.array([[-1, -1, 0], [2, -1, 0], [-1, 2, 0]], dtype)
    scene = wive.Scene(vertices, [[0, 1, 2]], backend=cpu_backend, accuracy=accuracy)
    tiny = np.finfo(dtype).smallest_subnormal
    origins = np.array([[0, 0, 0], [0, 0, 1e-20], [0, 0, tiny], [0, 0, -tiny], [0, 0, -1e-20]], dtype)
    for length in (1.0, 1e30):
        directions = np.tile(np.array([0, 0, length], dtype), (5, 1))
        right = np.array([True, False, False, True, True])
        np.testing.assert_array_equal(scene.occluded(origins, directions), right)
        np.testing.assert_array_equal(scene.count(origins, directions) == 1, right)
        np.testing.assert_array_equal(scene.intersect(origins, directions).mask, right)
