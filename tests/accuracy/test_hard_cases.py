"""The hard cases of rays and triangles in both careful accuracies and node forms, on every CPU backend.

Tests with `backend` also run on Warp's CPU device. Oracles are exact rationals (support/oracle.py), or
geometry in double if the result is clear by more than the watertight test's error bound.
"""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.closed_meshes import DIRECTIONS, SHAPES, grid, leaving, nearness, placed, utm_terrain
from support.exact_answers import INFINITE, ZERO, truth_of, wrong_rays
from support.hard_sets import SETS, HardSet, few_bits, hard_set
from support.oracle import Truth, truth

import wive
from wive import _cpu

BACKENDS = [name for name, reason in _cpu.kernels().items() if not reason and "." not in name]
CAREFUL = ("watertight", "exact")
NODES = ("float32", "compressed")


@pytest.fixture(params=BACKENDS)
def cpu(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name


@pytest.fixture(params=NODES)
def nodes(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name


@pytest.fixture(params=CAREFUL)
def careful(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name


def scene_of(mesh: HardSet | tuple[np.ndarray, ...], backend: str, accuracy: str, nodes: str) -> wive.Scene:
    return wive.Scene(mesh[0], mesh[1], backend=backend, accuracy=accuracy, nodes=nodes)


def answers(scene: wive.Scene, rays: HardSet) -> Truth:
    hits = scene.intersect(rays.origins, rays.directions)
    return Truth(hits.t, hits.prim, hits.uv, scene.occluded(rays.origins, rays.directions))


@functools.cache
def lattice() -> tuple[HardSet, Truth]:
    """A box of integer cells; rays on lattice and half-lattice points, in slab planes, along signed zeros."""
    random = np.random.default_rng(51)
    origins = (random.integers(-2, 11, (1500, 3)) / 2).astype(np.float32)
    rays = HardSet(*grid(4), origins, DIRECTIONS[random.integers(len(DIRECTIONS), size=1500)])
    rays = rays._replace(
        origins=rays.origins[(rays.directions != 0).any(axis=1)],
        directions=rays.directions[(rays.directions != 0).any(axis=1)],
    )
    return rays, truth(*rays, ZERO, INFINITE)


def test_lattice_rays_with_signed_zeros_hit_as_exact_arithmetic_says(
    backend: str, careful: str, nodes: str
) -> None:
    rays, right = lattice()
    assert 0.2 < right.occluded.mean() < 0.95
    assert (np.signbit(rays.directions) & (rays.directions == 0)).any()
    found = answers(scene_of(rays, backend, careful, nodes), rays)
    np.testing.assert_array_equal(found.prim, right.prim)
    np.testing.assert_array_equal(found.t, right.t)
    np.testing.assert_array_equal(found.occluded, right.occluded)


@pytest.mark.parametrize("name", SETS)
def test_compressed_nodes_are_as_exact(cpu: str, name: str) -> None:
    rays = hard_set(name)
    found = answers(scene_of(rays, cpu, "exact", "compressed"), rays)
    assert len(wrong_rays(found, truth_of(name))) == 0


NEAR = ("slivers", "coincident faces", "thin walls", "nearly in plane", "sphere",
        "tiny sphere", "huge sphere", "sphere far away", "far origins")  # fmt: skip


@functools.cache
def nearness_of(name: str) -> tuple[np.ndarray, np.ndarray]:
    rays = hard_set(name)
    return nearness(rays[:2], rays.origins, rays.directions)


@pytest.mark.parametrize("name", NEAR)
def test_watertight_hits_what_it_must_and_nothing_beyond_its_bound(cpu: str, nodes: str, name: str) -> None:
    rays, (distance, t) = hard_set(name), nearness_of(name)
    found = answers(scene_of(rays, cpu, "watertight", nodes), rays)
    hit = np.flatnonzero(found.occluded)
    assert (distance[hit, found.prim[hit]] >= -1).all()
    # No triangle that the ray is certainly inside lies clearly before the reported hit.
    inside = distance > 1
    ahead = inside & (t > 1e-6 * np.median(np.abs(t[inside]))) if inside.any() else inside
    first = np.where(ahead, t, np.inf).min(axis=1)
    certain = np.isfinite(first)
    assert certain.sum() > 12 or name == "slivers"  # which are thinner than the bound
    assert len(hit) > 12
    two_ulp = 2 * np.spacing(first[certain].astype(np.float32))
    assert found.occluded[certain].all()
    assert (found.t[certain] <= first[certain] + two_ulp).all()
    # If only one triangle is near the ray, t is its exact distance to the nearest float.
    alone = np.flatnonzero(certain & ((distance > -1).sum(axis=1) == 1))
    assert np.array_equal(found.prim[alone], np.argmax(ahead[alone], axis=1))
    assert (np.abs(found.t[alone] - first[alone]) <= 2 * np.spacing(first[alone].astype(np.float32))).all()


def test_of_coincident_faces_the_lowest_is_hit(cpu: str, careful: str, nodes: str) -> None:
    rays, (distance, _) = hard_set("coincident faces"), nearness_of("coincident faces")
    corners = np.sort(rays.faces, axis=1)
    lowest = np.array([np.flatnonzero((corners == c).all(axis=1))[0] for c in corners])
    prim = answers(scene_of(rays, cpu, careful, nodes), rays).prim
    inside = (distance[np.arange(len(prim)), prim] > 1) & (prim >= 0)
    assert inside.sum() > 200
    assert (lowest[prim[inside]] == prim[inside]).all()


def test_exact_rays_in_a_triangles_plane_miss_it_whatever_the_plane(cpu: str, nodes: str) -> None:
    random = np.random.default_rng(52)
    for _ in range(60):
        a, b, c = few_bits(random, 3, 9)
        if not np.cross(b - a, c - a).any():
            continue
        s, r = random.integers(-4, 5, (2, 30, 2)).astype(np.float32)
        r = r[r.any(axis=1)]
        origins = a + s[: len(r), :1] * (b - a) + s[: len(r), 1:] * (c - a)
        directions = r[:, :1] * (b - a) + r[:, 1:] * (c - a)
        mesh = np.stack([a, b, c]), np.int32([[0, 1, 2]])
        assert not scene_of(mesh, cpu, "exact", nodes).occluded(origins, directions).any()
        # A ray from above the plane, along the normal to the middle, hits.
        normal = np.cross(b - a, c - a)
        above = (a + b + c) + 3 * normal, -normal
        assert scene_of((3 * mesh[0], mesh[1]), cpu, "exact", nodes).occluded(*above).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rays_in_the_plane_of_an_axis_aligned_wall_miss_it(
    backend: str, careful: str, nodes: str, axis: int
) -> None:
    random = np.random.default_rng(53)
    flat = random.uniform(-4, 4, (40, 2)).astype(np.float32)
    vertices = np.insert(flat, axis, 0.7, axis=1).astype(np.float32)
    faces = np.arange(39, dtype=np.int32).reshape(-1, 3)
    origins = np.insert(random.uniform(-5, 5, (500, 2)), axis, np.float32(0.7), axis=1).astype(np.float32)
    directions = np.insert(random.standard_normal((500, 2)), axis, 0.0, axis=1).astype(np.float32)
    directions[::2, axis] = -0.0
    scene = scene_of((vertices, faces), backend, careful, nodes)
    assert not scene.occluded(origins, directions).any()
    directions[:, axis] = 1e-3
    origins[:, axis] -= 1e-3
    assert scene.occluded(origins, directions).mean() > 0.1


@functools.cache
def silhouette() -> tuple[HardSet, np.ndarray, Truth]:
    """Rays past the edges of a box, at them and beside them by 2^-18, 2^-6. Third result: how far outside."""
    random = np.random.default_rng(54)
    count = 900
    axis, along = random.integers(3, size=count), random.integers(0, 17, count) / 4
    edge = 4.0 * random.integers(2, size=(count, 3))
    edge[np.arange(count), axis] = along
    outward = np.where(edge > 2, 1.0, -1.0)
    outward[np.arange(count), axis] = 0
    # Across the edge, so that the ray enters no box: up one side's normal, down the other's.
    first, second = (axis + 1) % 3, (axis + 2) % 3
    directions = np.zeros((count, 3))
    directions[np.arange(count), first] = outward[np.arange(count), first] * random.integers(1, 4, count)
    directions[np.arange(count), second] = -outward[np.arange(count), second] * random.integers(1, 4, count)
    directions[np.arange(count), axis] = random.integers(-2, 3, count)
    outside = random.choice([-(2.0**-6), -(2.0**-18), 0, 2.0**-18, 2.0**-6], count)
    origins = edge - 4 * directions + outside[:, None] * outward
    rays = HardSet(*grid(4), origins.astype(np.float32), directions.astype(np.float32))
    assert np.array_equal(rays.origins, origins)
    return rays, outside, truth(*rays, ZERO, INFINITE)


def test_silhouettes_of_boxes_are_sharp(backend: str, careful: str, nodes: str) -> None:
    rays, outside, right = silhouette()
    found = answers(scene_of(rays, backend, careful, nodes), rays)
    clear = np.abs(outside) > 2.0**-10 if careful == "watertight" else np.ones(len(outside), bool)
    assert 0.3 < right.occluded[clear].mean() < 0.7
    np.testing.assert_array_equal(found.occluded[clear], right.occluded[clear])
    np.testing.assert_array_equal(found.t[clear], right.t[clear])


def test_rays_down_on_a_terrain_in_utm_land_where_its_vertices_are(
    cpu: str, careful: str, nodes: str
) -> None:
    vertices, faces = utm_terrain()
    scene = scene_of((vertices, faces), cpu, careful, nodes)
    inner = vertices[(vertices[:, :2] > vertices[:, :2].min(axis=0)).all(axis=1)]
    below = inner * np.float32([1, 1, 0]) + np.float32([0, 0, 4096])
    hits = scene.intersect(below, np.float32([0, 0, -1]))
    np.testing.assert_array_equal(hits.t, (4096 - inner[:, 2].astype(np.float64)).astype(np.float32))
    between = (vertices[faces].mean(axis=1, dtype=np.float64) + np.array([0, 0, 500])).astype(np.float32)
    assert scene.occluded(between, np.float32([0, 0, -1])).all()


def test_exact_on_a_terrain_in_utm_is_exact(cpu: str, nodes: str) -> None:
    vertices, faces = utm_terrain(8)
    random = np.random.default_rng(55)
    targets = vertices[random.integers(len(vertices), size=300)] + random.choice([0, 0.5, 5], (300, 1))
    origins = vertices.mean(axis=0) + [0, 0, 1000] + 400 * random.uniform(-1, 1, (300, 3))
    origins = origins.astype(np.float32)
    rays = HardSet(vertices, faces, origins, (targets - origins).astype(np.float32))
    right = truth(*rays, ZERO, INFINITE)
    assert right.occluded.mean() > 0.2
    assert len(wrong_rays(answers(scene_of(rays, cpu, "exact", nodes), rays), right)) == 0


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.sampled_from(sorted(SHAPES)),
    st.integers(-100, 45),
    st.tuples(*[st.floats(-1000, 1000)] * 3),
    st.integers(0, 2**31),
)
def test_no_closed_mesh_leaks_at_its_vertices_and_edges_and_exact_is_right(
    shape: str, exponent: int, place: tuple[float, ...], seed: int
) -> None:
    scale = 2.0**exponent
    mesh = placed(SHAPES[shape], scale, scale * np.array(place))
    origins, directions = leaving(mesh, 200, np.random.default_rng(seed))
    some = slice(0, 6)
    right = truth(*mesh, origins[some], directions[some], ZERO, INFINITE)
    for accuracy in CAREFUL:
        for form in NODES:
            bvh = _cpu.Bvh(*mesh, accuracy, nodes=form)
            for kernel in BACKENDS:
                rays = kernel, origins, directions, ZERO, INFINITE
                t, prim, uv, _ = bvh.intersect(*rays, threads=1)
                occluded = bvh.occluded(*rays, threads=1)[0]
                assert (prim >= 0).all() and occluded.all()
                assert (bvh.count(*rays, threads=1)[0] % 2 == 1).all() or accuracy == "watertight"
                if accuracy == "exact":
                    found = Truth(t[some], prim[some], uv[some], occluded[some])
                    assert len(wrong_rays(found, right)) == 0
