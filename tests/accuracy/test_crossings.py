"""`count` and `intersect_all` report crossings in `watertight` as well, in either precision.

A ray through an edge or a vertex crosses a closed surface as often as a ray beside it.
"""

import functools
from typing import Literal

import numpy as np
import pytest
from support.closed_meshes import DIRECTIONS, SCALES, SHAPES, TETRAHEDRON, Mesh, grid
from support.flat_pictures import triangles_met
from support.hard_rays import grid as open_grid
from support.hard_sets import SETS, hard_set
from support.meshes import sphere
from support.oracle import cross, integers, unit_of
from support.voxels import SIDE, surface_rays, voxels

import wive
from wive import _cpu
from wive._internal.distant import MOST_COORDINATE, Ball

Nodes = Literal["float32", "compressed"]
KINDS = [(np.float32, "float32"), (np.float32, "compressed"), (np.float64, "float32")]
OCTAHEDRON = (
    np.concatenate([np.eye(3), -np.eye(3)]),
    np.array([[i, j, k] if s > 0 else [i, k, j] for i, j, k, s in [
        (a, 1 + b, 2 + c, (1 if a == 0 else -1) * (1 if b == 0 else -1) * (1 if c == 0 else -1))
        for a in (0, 3) for b in (0, 3) for c in (0, 3)
    ]], np.int32),
)  # fmt: skip
SOLIDS = {**SHAPES, "octahedron": OCTAHEDRON, "finer sphere": sphere(2), "grid": (grid(4)[0] - 2, grid(4)[1])}
PLACES = [(1.0, (0, 0, 0)), *((scale, (0, 0, 0)) for scale in SCALES), (1e3, (148376, 1234, -223423))]


def turned(mesh: Mesh, random: np.random.Generator) -> np.ndarray:
    """The vertices, turned at random about the coordinates' origin, in double."""
    turn, _ = np.linalg.qr(random.standard_normal((3, 3)))
    return np.asarray(mesh[0] @ turn)


def at_hard_places(vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray) -> Mesh:
    """Rays from each origin at each vertex and middle of an edge, then along DIRECTIONS, in one dtype."""
    corners = vertices[faces].astype(np.float64)
    aims = np.concatenate([vertices, corners[:, :2].mean(axis=1), corners[:, 1:].mean(axis=1)])
    starts = origins.astype(vertices.dtype)
    ways = aims[:, None] - starts
    along = np.broadcast_to(DIRECTIONS[:, None], (len(DIRECTIONS), *starts.shape))
    rays = [(np.broadcast_to(starts, some.shape), some) for some in (ways, along)]
    ends = [np.concatenate([part.reshape(-1, 3) for part in parts]) for parts in zip(*rays, strict=True)]
    return ends[0], ends[1].astype(vertices.dtype)


@pytest.mark.parametrize("accuracy", ["watertight", "exact"])
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_box_is_crossed_once_from_its_centre_along_each_axis(
    cpu_backend: str, dtype: type, nodes: Nodes, accuracy: Literal["watertight", "exact"]
) -> None:
    vertices, faces = SHAPES["box"]
    if accuracy == "exact" and dtype is np.float64:
        pytest.skip("exact takes float32 numbers only")
    scene = wive.Scene(vertices.astype(dtype), faces, backend=cpu_backend, accuracy=accuracy, nodes=nodes)
    axes = np.concatenate([np.eye(3), -np.eye(3)]).astype(dtype)
    assert scene.count(np.zeros(3), axes).tolist() == [1] * 6
    assert scene.count(-3 * axes, axes).tolist() == [2] * 6
    found = scene.intersect_all(np.zeros(3), axes)
    assert found.offsets.tolist() == list(range(7)) and found.t.tolist() == [1] * 6
    assert scene.count(np.zeros(3), axes, touching=True).tolist() == [2] * 6


@pytest.mark.parametrize(("dtype", "nodes"), KINDS)
@pytest.mark.parametrize("name", SOLIDS)
def test_convex_solids_are_crossed_once_from_inside_and_twice_by_lines(
    cpu_backend: str, name: str, dtype: type, nodes: Nodes
) -> None:
    """Turned at random, at every scale and place; rays at vertices, at middles of edges and along axes."""
    for case, (scale, place) in enumerate(PLACES):
        random = np.random.default_rng(case)
        points = SOLIDS[name][0] if case == 0 else turned(SOLIDS[name], random)
        vertices = (points * scale + np.array(place)).astype(dtype)
        faces = SOLIDS[name][1]
        middle = vertices.mean(axis=0, dtype=np.float64)
        origins = middle + scale * np.concatenate([np.zeros((1, 3)), random.uniform(-0.1, 0.1, (2, 3))])
        rays = at_hard_places(vertices, faces, origins)
        scene = wive.Scene(vertices, faces, backend=cpu_backend, nodes=nodes)
        assert (scene.count(*rays) == 1).all()
        assert (scene.count(*rays, tmin=-np.inf) == 2).all()


@pytest.mark.parametrize("scale", [1e-40, 1e-90, 1e-150, 1e-200, 1e-290])
def test_products_that_would_underflow_lose_no_crossing(cpu_backend: str, scale: float) -> None:
    """Solids so small that the edge functions of doubles would all be zero."""
    for name in ("box", "sphere"):
        vertices, faces = turned(SHAPES[name], np.random.default_rng(8)) * scale, SHAPES[name][1]
        rays = at_hard_places(vertices, faces, scale * np.array([[0, 0, 0], [0.1, -0.05, 0.07]]))
        for factor in (1.0, 1 / scale):
            scene = wive.Scene(vertices, faces, backend=cpu_backend)
            assert (scene.count(rays[0], factor * rays[1]) == 1).all()
            hits = scene.intersect(rays[0], factor * rays[1])
            assert hits.mask.all()
            aimed = len(rays[0]) - 2 * len(DIRECTIONS)
            np.testing.assert_allclose(hits.t[:aimed] * factor, 1, rtol=1e-9)


@pytest.mark.parametrize(("dtype", "nodes"), KINDS)
def test_an_open_sheet_is_crossed_once_away_from_its_border(
    cpu_backend: str, dtype: type, nodes: Nodes
) -> None:
    """A wall seen from its middle, at every scale and place, at inner vertices and edges and between them."""
    sheet = open_grid(40)
    for case, (scale, place) in enumerate(PLACES):
        random = np.random.default_rng(case)
        turn = np.eye(3) if case % 2 else np.linalg.qr(random.standard_normal((3, 3)))[0]
        vertices = ((sheet[0] / 20 - [1, 1, 0]) @ turn * scale + np.array(place)).astype(dtype)
        corners = vertices[sheet[1][random.integers(len(sheet[1]), size=2000)]].astype(np.float64)
        weights = random.random((2000, 2)) * random.integers(2, size=(2000, 2))
        aims = corners[:, 0] + weights[:, :1] * (corners[:, 1] - corners[:, 0])
        aims += weights[:, 1:] * (corners[:, 2] - aims)
        flat = ((aims - np.array(place)) @ turn.T)[:, :2] / scale
        aims = aims[(abs(flat) < 0.96).all(axis=1)]
        origin = (np.array([0, 0, 1]) @ turn * scale + np.array(place)).astype(dtype)
        directions = (aims - origin).astype(dtype)
        scene = wive.Scene(vertices, sheet[1], backend=cpu_backend, nodes=nodes)
        for tmin in (0, -np.inf):
            assert (scene.count(origin, directions, tmin=tmin) == 1).all()
        assert (scene.count(origin, -directions) == 0).all()
        assert scene.occluded(origin, directions).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lines_cross_closed_solids_evenly_from_outside(dtype: type) -> None:
    """Silhouettes, corners and faces seen edge-on count nothing or two."""
    for case, mesh in enumerate(SOLIDS.values()):
        random = np.random.default_rng(case)
        for points in (np.asarray(mesh[0]), turned(mesh, random)):
            vertices, faces = points.astype(dtype), mesh[1]
            away = np.concatenate([4 * np.eye(3), random.uniform(-4, 4, (5, 3)), points[:4] * 3])
            rays = at_hard_places(vertices, faces, away)
            scene = wive.Scene(vertices, faces)
            counts = scene.count(*rays, tmin=-np.inf)
            assert set(np.unique(counts)) <= {0, 2}
            assert (counts == 2).mean() > 0.1
            outside = np.linalg.norm(rays[0], axis=1) > 2 * np.linalg.norm(vertices, axis=1).max()
            np.testing.assert_array_equal(scene.count(*rays)[outside] % 2, 0)


@functools.cache
def layers(name: str) -> tuple[np.ndarray, np.ndarray, int]:
    """A mesh and how often a ray from the origin crosses it."""
    vertices, faces = sphere(1)
    if name == "nested spheres":
        radii = [1, 1.5, 2, 2 + 1e-5, 4]
        return (
            np.concatenate([vertices * radius for radius in radii]),
            np.concatenate([faces + i * len(vertices) for i in range(len(radii))]),
            len(radii),
        )
    if name == "doubled faces":
        return vertices, np.concatenate([faces, faces[:, [1, 2, 0]]]), 2
    if name == "inner faces turned":
        return np.concatenate([vertices, 2 * vertices]), np.concatenate([faces[:, ::-1], faces + 42]), 2
    if name == "soup of triangles":
        return vertices[faces].reshape(-1, 3), np.arange(faces.size, dtype=np.int32).reshape(-1, 3), 1
    vertices, faces = SHAPES["box"]
    return vertices * np.array([1, 1, 1e-4], np.float32), faces, 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "name", ["nested spheres", "doubled faces", "inner faces turned", "soup of triangles", "thin slab"]
)
def test_each_layer_counts_once(cpu_backend: str, name: str, dtype: type) -> None:
    vertices, faces, right = layers(name)
    rays = at_hard_places(vertices.astype(dtype), faces, np.zeros((1, 3)))
    scene = wive.Scene(vertices.astype(dtype), faces, backend=cpu_backend)
    assert (scene.count(*rays) == right).all()


@pytest.mark.parametrize(("dtype", "nodes"), KINDS)
@pytest.mark.parametrize("seed", [1, 2])
def test_parity_tells_inside_from_outside(cpu_backend: str, seed: int, dtype: type, nodes: Nodes) -> None:
    """Rays from voxels at their corners, along their edges and in their faces."""
    vertices, faces, filled = voxels(seed)
    origins, directions = surface_rays(vertices, seed + 1, 1000)
    cells = np.floor(origins).astype(int)
    within = ((cells >= 0) & (cells < SIDE)).all(axis=1)
    inside = within & filled[tuple(np.clip(cells, 0, SIDE - 1).T)]
    scene = wive.Scene(vertices.astype(dtype), faces, backend=cpu_backend, nodes=nodes)
    counts = scene.count(origins.astype(dtype), directions.astype(dtype))
    np.testing.assert_array_equal(counts % 2 == 1, inside)


@pytest.mark.parametrize(("dtype", "nodes"), KINDS)
def test_all_rays_from_one_place_agree_in_parity(cpu_backend: str, dtype: type, nodes: Nodes) -> None:
    """Two overlapping spheres with spikes and dents, at every scale and place."""
    random = np.random.default_rng(9)
    ball, faces = sphere(2)
    spiked = ball * random.uniform(0.3, 1, (len(ball), 1))
    both = (
        np.concatenate([spiked, turned((spiked, faces), random) + 0.3]),
        np.concatenate([faces, faces + len(ball)]),
    )
    for scale, place in PLACES:
        vertices = (turned(both, random) * scale + np.array(place)).astype(dtype)
        origins = scale * random.uniform(-1, 1, (6, 3)) + np.array(place)
        scene = wive.Scene(vertices, both[1], backend=cpu_backend, nodes=nodes)
        rays = at_hard_places(vertices, both[1], origins)
        odd = scene.count(*rays).reshape(-1, len(origins)) % 2
        assert (odd == odd[0]).all()
        assert (scene.count(*rays, tmin=-np.inf) % 2 == 0).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", ["voxels", *SETS])
def test_every_backend_crosses_the_same_triangles(usable_backends: list[str], name: str, dtype: type) -> None:
    """Those that brute force in integers finds in the rounded picture, and those it touches."""
    backends = list(usable_backends)
    if (name, dtype) != ("voxels", np.float32) and "warp" in backends:
        backends.remove("warp")  # its kernels are compiled for one set and precision
    if name == "voxels":
        vertices, faces, _ = voxels(3)
        origins, directions = surface_rays(vertices, 5, 60)
    else:
        vertices, faces, origins, directions = hard_set(name)
    some = np.random.default_rng(6).permutation(len(origins))[:60]
    mesh = vertices.astype(dtype), faces
    rays = origins[some].astype(dtype), directions[some].astype(dtype)
    solid = has_area(vertices, faces)
    for touching in (False, True):
        right = triangles_met(*mesh, *as_traced(wive.Scene(*mesh), *rays), touching=touching) & solid
        for backend in backends:
            scene = wive.Scene(*mesh, backend=backend)
            found = scene.intersect_all(*rays, tmin=-np.inf, touching=touching)
            met = np.zeros_like(right)
            met[np.repeat(np.arange(len(some)), np.diff(found.offsets)), found.prim] = True
            np.testing.assert_array_equal(met, right)
            np.testing.assert_array_equal(
                scene.count(*rays, tmin=-np.inf, touching=touching), right.sum(axis=1)
            )


def as_traced(
    scene: wive.Scene, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The rays as the core traces them: those that start far away from a float32 scene are brought near."""
    if origins.dtype == np.float64:
        return origins, directions
    ball = Ball.around(scene.bounds, scene._bvh.far_distance)
    given = origins.astype(np.float64), directions.astype(np.float64)
    limits = np.float32([-np.inf]), np.float32([np.inf])
    brought = _cpu.bring_near(*given, origins, directions, *limits, *ball, MOST_COORDINATE, kept=False)
    return (origins if brought is None else brought[0]), directions


def has_area(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(f,) whether a triangle's exact area is not zero."""
    a, b, c = integers(vertices, unit_of(vertices))[faces].swapaxes(0, 1)
    return (cross(b - a, c - a) != 0).any(axis=-1)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("accuracy", ["fast", "watertight", "exact"])
def test_touching_begins_with_what_intersect_reports(
    cpu_backend: str, dtype: type, accuracy: Literal["fast", "watertight", "exact"]
) -> None:
    if accuracy == "exact" and dtype is np.float64:
        pytest.skip("exact takes float32 numbers only")
    vertices, faces = TETRAHEDRON[0].astype(dtype), TETRAHEDRON[1]
    rays = at_hard_places(vertices, faces, np.array([[0.1, 0.2, -0.1], [3, 3, 3], [0, 5, 0]]))
    scene = wive.Scene(vertices, faces, backend=cpu_backend, accuracy=accuracy)
    closest, every = scene.intersect(*rays), scene.intersect_all(*rays, touching=True)
    hit = np.diff(every.offsets) > 0
    np.testing.assert_array_equal(hit, closest.mask)
    first = every.offsets[:-1][hit]
    np.testing.assert_array_equal(every.t[first], closest.t[hit])
    np.testing.assert_array_equal(every.prim[first], closest.prim[hit])
    assert accuracy == "fast" or (scene.count(*rays, touching=True) > scene.count(*rays)).any()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_interval_is_split_without_losing_or_doubling_a_crossing(dtype: type) -> None:
    vertices, faces, right = layers("nested spheres")
    vertices = vertices.astype(dtype)
    rays = at_hard_places(vertices, faces, np.zeros((1, 3)))
    scene = wive.Scene(vertices, faces)
    found = scene.intersect_all(*rays)
    for layer in range(right):
        t = found.t[found.offsets[:-1] + layer]
        before, after = scene.count(*rays, tmax=t), scene.count(*rays, tmin=np.nextafter(t, dtype(np.inf)))
        np.testing.assert_array_equal(before + after, right)
        assert (scene.count(*rays, tmin=t, tmax=t) >= 1).all()
