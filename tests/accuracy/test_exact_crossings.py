"""In exact mode `count` and `intersect_all` cross closed surfaces consistently: parity is always right.

The oracle moves the rays by an amount too small to matter otherwise, in integers, and has no rule for ties.
"""

import functools
from typing import Literal

import numpy as np
import pytest
from support.closed_meshes import DIRECTIONS, grid
from support.hard_sets import HardSet, hard_set
from support.meshes import sphere
from support.oracle import crossings, meetings, nearest_float
from support.voxels import SIDE, surface_rays, voxels

import wive


@functools.cache
def voxel_case(seed: int) -> tuple[HardSet, np.ndarray, np.ndarray]:
    vertices, faces, filled = voxels(seed)
    origins, directions = surface_rays(vertices, seed + 1, 250)
    cells = np.floor(origins).astype(int)
    within = ((cells >= 0) & (cells < SIDE)).all(axis=1)
    inside = within & filled[tuple(np.clip(cells, 0, SIDE - 1).T)]
    rays = HardSet(vertices, faces, origins, directions)
    return rays, crossings(*rays), inside


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize("seed", [1, 2])
def test_parity_tells_inside_from_outside(
    backend: str, seed: int, nodes: Literal["float32", "compressed"]
) -> None:
    rays, right, inside = voxel_case(seed)
    scene = wive.Scene(rays.vertices, rays.faces, backend=backend, accuracy="exact", nodes=nodes)
    counts = scene.count(rays.origins, rays.directions)
    np.testing.assert_array_equal(counts % 2 == 1, inside)
    np.testing.assert_array_equal(counts, right)


def test_rays_in_the_planes_of_faces_keep_parity(backend: str) -> None:
    """From outside, along grid lines, edges and face diagonals of a box."""
    vertices, faces = grid(3)
    places = np.stack(np.meshgrid(*[np.arange(0, 3.5, 0.5)] * 3), axis=-1).reshape(-1, 3)
    directions = np.repeat(DIRECTIONS[np.abs(DIRECTIONS).max(axis=1) > 0], len(places), axis=0)
    origins = (np.tile(places, (len(directions) // len(places), 1)) - 8 * directions).astype(np.float32)
    scene = wive.Scene(vertices, faces, backend=backend, accuracy="exact")
    counts = scene.count(origins, directions)
    assert set(np.unique(counts)) == {0, 2}
    some = np.random.default_rng(4).permutation(len(origins))[:150]
    np.testing.assert_array_equal(counts[some], crossings(vertices, faces, origins[some], directions[some]))


@pytest.mark.parametrize("place", [(0, 0, 0), (148376, 1234, -223423)])
def test_rays_at_vertices_and_edges_leave_a_sphere_once(backend: str, place: tuple[float, ...]) -> None:
    vertices, faces = sphere(3, radius=100.0)
    vertices = (vertices + np.array(place)).astype(np.float32)
    random = np.random.default_rng(5)
    aims = np.concatenate([vertices, vertices[faces][:, :2].mean(axis=1)]).astype(np.float32)
    origins = (np.array(place) + random.uniform(-50, 50, aims.shape)).astype(np.float32)
    scene = wive.Scene(vertices, faces, backend=backend, accuracy="exact")
    assert (scene.count(origins, aims - origins) == 1).all()
    assert (scene.count(origins, aims - origins, tmin=-np.inf) == 2).all()


def test_without_the_rule_edges_would_count_twice(backend: str) -> None:
    """Of the triangles touched there are too many on these rays."""
    rays, right, _ = voxel_case(1)
    scene = wive.Scene(rays.vertices, rays.faces, backend=backend, accuracy="exact")
    assert (scene.count(rays.origins, rays.directions, touching=True) > right).mean() > 0.1


def test_all_hits_are_the_crossings_with_exact_numbers(backend: str) -> None:
    rays, right, _ = voxel_case(2)
    some = slice(0, 150)
    rays = rays._replace(origins=rays.origins[some], directions=rays.directions[some])
    found = wive.Scene(rays.vertices, rays.faces, backend=backend, accuracy="exact").intersect_all(
        rays.origins, rays.directions
    )
    np.testing.assert_array_equal(np.diff(found.offsets), right[some])
    met = meetings(*rays)
    for ray in range(len(rays.origins)):
        rows = slice(found.offsets[ray], found.offsets[ray + 1])
        distances = [met.t(ray, prim) for prim in found.prim[rows]]
        assert distances == sorted(distances)
        assert [nearest_float(t) for t in distances] == found.t[rows].tolist()


def test_all_hits_of_rounded_numbers_are_the_crossings(backend: str) -> None:
    """Coordinates with all bits used: each hit is on a closed triangle, and its t is rightly rounded."""
    rays = hard_set("thin walls")
    rays = rays._replace(origins=rays.origins[:200], directions=rays.directions[:200])
    scene = wive.Scene(rays.vertices, rays.faces, backend=backend, accuracy="exact")
    found = scene.intersect_all(rays.origins, rays.directions)
    np.testing.assert_array_equal(np.diff(found.offsets), scene.count(rays.origins, rays.directions))
    met = meetings(*rays)
    ray = np.repeat(np.arange(200), np.diff(found.offsets))
    assert met.inside[ray, found.prim].all() and len(ray) > 300
    assert [nearest_float(met.t(*pair)) for pair in zip(ray, found.prim, strict=True)] == found.t.tolist()
