"""The properties of the hard cases with millions of rays: --slow, about half an hour on two cores."""

from collections.abc import Iterator

import numpy as np
import pytest
from support.closed_meshes import SCALES, TETRAHEDRON, grid, leaving, placed
from support.meshes import soup, sphere
from support.oracle import nearest_float
from support.pairs import exact_distances, exact_prims

import wive

CHUNK = 500_000
PLACES = [
    (148376.0, 1234.0, -223423.0),
    (-3e6, 2e6, 1e6),
    (500_000.0, 5_400_000.0, 300.0),
    (1e4, 0.0, 0.0),
    (0.0, 0.0, -65536.0),
]
CASES = [(scale, (0.0, 0.0, 0.0)) for scale in SCALES] + [(1000.0, place) for place in PLACES]
FORMS = [(accuracy, nodes) for accuracy in ("watertight", "exact") for nodes in ("float32", "compressed")]
Mesh = tuple[np.ndarray, np.ndarray]
Rays = tuple[np.ndarray, np.ndarray]


def chunks(mesh: Mesh, count: int, seed: int) -> Iterator[Rays]:
    for part in range(0, count, CHUNK):
        yield leaving(mesh, min(CHUNK, count - part), np.random.default_rng((seed, part)), spread=0.25)


def leaks(scene: wive.Scene, rays: Rays) -> int:
    return int((~scene.intersect(*rays).mask).sum() + (~np.asarray(scene.occluded(*rays))).sum())


@pytest.mark.slow
@pytest.mark.timeout(1800)  # at vertices far from the origin, exact mode decides most rays in integers
@pytest.mark.parametrize(("scale", "place"), CASES)
def test_ten_million_rays_at_vertices_and_edges_never_leak(
    backend: str, usable_backends: list[str], scale: float, place: tuple[float, ...]
) -> None:
    """In exact mode on the first backend alone: all backends share the integer arithmetic."""
    if backend == "warp":
        pytest.skip("warp: a million, below")
    asked = FORMS if backend == usable_backends[0] else FORMS[:2]
    mesh = placed(sphere(6), scale, place)
    scenes = [wive.Scene(*mesh, backend=backend, accuracy=mode, nodes=nodes) for mode, nodes in asked]
    for rays in chunks(mesh, 10_000_000, 81):
        assert [leaks(scene, rays) for scene in scenes] == [0] * len(asked)


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "place"), [CASES[2], CASES[5]])
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_a_million_rays_at_vertices_and_edges_never_leak_on_any_backend(
    backend: str, nodes: str, scale: float, place: tuple[float, ...]
) -> None:
    mesh = placed(sphere(6), scale, place)
    scene = wive.Scene(*mesh, backend=backend, nodes=nodes)
    assert sum(leaks(scene, rays) for rays in chunks(mesh, 1_000_000, 82)) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "place"), [CASES[0], CASES[2], CASES[5], CASES[7]])
def test_parity_is_right_at_a_million_vertices_and_edges(scale: float, place: tuple[float, ...]) -> None:
    mesh = placed(sphere(6), scale, place)
    scene = wive.Scene(*mesh, accuracy="exact")
    middle = (mesh[0].max(axis=0).astype(np.float64) + mesh[0].min(axis=0)) / 2
    for origins, directions in chunks(mesh, 1_000_000, 83):
        assert (scene.count(origins, directions) % 2 == 1).all()
        targets = origins.astype(np.float64) + directions
        outside = (middle + 1.5 * (middle - targets)[::-1]).astype(np.float32)
        assert (scene.count(outside, (targets - outside).astype(np.float32)) % 2 == 0).all()


CLOSEST = {
    "tetrahedron": placed(TETRAHEDRON, 0.3, (5.0, -7.0, 11.0)),
    "grid": grid(3),
    "sphere": placed(sphere(1), 1000.0, (148376.0, 1234.0, -223423.0)),
    "triangles that cross": soup(60, 84),
}


def at_anything(mesh: Mesh, count: int, seed: int) -> Rays:
    """Two thirds at vertices and edges, one third anywhere."""
    random = np.random.default_rng(seed)
    origins, directions = leaving(mesh, count, random, spread=0.6)
    third = count // 3
    directions[:third] = random.standard_normal((third, 3)) * np.abs(directions).mean()
    return origins, directions


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSEST)
def test_of_a_million_rays_exact_names_no_wrong_triangle(name: str) -> None:
    mesh = CLOSEST[name]
    for seed in range(5):
        rays = at_anything(mesh, 50_000, seed)
        right = exact_prims(*mesh, *rays)
        for nodes in ("float32", "compressed"):
            prim = wive.Scene(*mesh, accuracy="exact", nodes=nodes).intersect(*rays).prim
            np.testing.assert_array_equal(prim, right)


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSEST)
def test_t_is_rounded_once_in_exact_and_within_two_ulp_in_watertight(name: str) -> None:
    mesh = CLOSEST[name]
    origins, directions = at_anything(mesh, 60_000, 85)
    for accuracy, nodes in FORMS:
        hits = wive.Scene(*mesh, accuracy=accuracy, nodes=nodes).intersect(origins, directions)
        normals, unit = hits.normals(), directions / np.linalg.norm(directions, axis=1, keepdims=True)
        steep = np.abs((normals * unit).sum(axis=1)) > 0.05
        inside = np.minimum(hits.uv.min(axis=1), 1 - hits.uv.sum(axis=1)) > 1e-3
        size = np.ptp(mesh[0], axis=0).max() / np.linalg.norm(directions, axis=1)
        chosen = np.flatnonzero(
            hits.mask & (steep & inside & (hits.t > 0.01 * size) if accuracy == "watertight" else hits.mask)
        )
        assert len(chosen) > 5000
        exact = exact_distances(*mesh, origins[chosen], directions[chosen], hits.prim[chosen])
        if accuracy == "exact":
            assert [nearest_float(t) for t in exact] == hits.t[chosen].tolist()
        else:
            true = np.array([float(t) for t in exact])
            assert (np.abs(hits.t[chosen] - true) <= 2 * np.spacing(true.astype(np.float32))).all()
