"""Rays that need neither conversion nor a check in Python get the answers that all others get."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from support.meshes import soup

import wive

Rays = tuple[Any, Any, Any, Any]
RNG = np.random.default_rng(5)
ORIGINS, DIRECTIONS = RNG.random((2, 200, 3)) - 0.25


class OfUsers(np.ndarray):
    """A subclass, which may mean anything by its numbers."""


def unaligned(array: np.ndarray) -> np.ndarray:
    """A copy at an odd address."""
    room = np.empty(array.nbytes + 1, np.uint8)
    copy = room[1:].view(array.dtype).reshape(array.shape)
    copy[:] = array
    return copy


CHANGES: dict[str, Callable[[Rays], Rays]] = {
    "as they are": lambda rays: rays,
    "lists": lambda rays: (rays[0].tolist(), rays[1].tolist(), *rays[2:]),
    "a subclass": lambda rays: (rays[0].view(OfUsers), rays[1], *rays[2:]),
    "another order": lambda rays: (np.asfortranarray(rays[0]), rays[1], *rays[2:]),
    "an odd address": lambda rays: (rays[0], unaligned(rays[1]), *rays[2:]),
    "integers for limits": lambda rays: (*rays[:2], 0, rays[3]),
    "limits per ray": lambda rays: (*rays[:2], np.zeros(200), rays[3]),
}


def answers(scene: wive.Scene, rays: Rays, **options: Any) -> list[np.ndarray]:
    hits = scene.intersect(*rays, **options)
    found = [hits.t, hits.prim, hits.uv, hits.error_bound, hits.spawn(-DIRECTIONS)]
    return [*found, scene.occluded(*rays, **options), scene.count(*rays, **options)]


@pytest.mark.parametrize("tmax", [np.inf, 0.5, 0.1])  # no float is 0.1
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_answers_do_not_depend_on_how_rays_are_held(cpu_backend: str, dtype: type, tmax: float) -> None:
    vertices, faces = soup(300, seed=3)
    scene = wive.Scene(vertices.astype(dtype), faces, backend=cpu_backend)
    rays = ORIGINS.astype(dtype), DIRECTIONS.astype(dtype), 0.0, tmax
    expected = answers(scene, rays, in_flight=7)  # options are always checked
    assert 20 < np.count_nonzero(expected[1] >= 0) < 190
    for name, change in CHANGES.items():
        for found, right in zip(answers(scene, change(rays)), expected, strict=True):
            np.testing.assert_array_equal(found, right, err_msg=name)


def test_masked_rays_miss() -> None:
    scene = wive.Scene(*soup(300, seed=3))
    origins, directions = ORIGINS.astype(np.float32), DIRECTIONS.astype(np.float32)
    (hit,) = np.nonzero(scene.occluded(origins, directions))
    mask = np.zeros(origins.shape, bool)
    mask[hit[0], 1] = True
    assert not scene.occluded(np.ma.MaskedArray(origins, mask), directions)[hit[0]]


def test_a_refitted_scene_answers_for_its_new_vertices() -> None:
    vertices, faces = soup(300, seed=3)
    vertices = vertices.astype(np.float32)
    scene = wive.Scene(vertices, faces)
    scene.refit(vertices + np.float32(8))
    origins, directions = ORIGINS.astype(np.float32) + np.float32(8), DIRECTIONS.astype(np.float32)
    hits = scene.intersect(origins, directions)
    assert hits.mask.any()
    assert hits.vertices is scene.vertices
