"""Trees with nodes="compressed": smaller, conservative, and the same hits bit for bit."""

import pickle
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.compressed_trees import (
    LEAF,
    MESHES,
    NO_CHILD,
    NODE_WORDS,
    all_prims,
    blocks,
    children,
    decode_planes,
    exact_box,
    orders,
    walk,
)
from support.meshes import TRIANGLE, assert_same_hits, random_rays, soup, sphere

import wive
from wive import _cpu

Mesh = tuple[np.ndarray, np.ndarray]

ACCURACIES = ("fast", "watertight", "exact")
U = 2.0**-24  # roundoff of float32
FORMS = ("float32", "compressed")
CPU_BACKENDS = [name for name in wive.backend.CPU_BACKENDS if wive.backends()[name].usable]
ZERO, INFINITE = np.zeros(1, np.float32), np.full(1, np.inf, np.float32)


@pytest.fixture(params=MESHES)
def mesh(request: pytest.FixtureRequest) -> Mesh:
    return MESHES[request.param]()


def both(mesh: Mesh, accuracy: str) -> list[_cpu.Bvh]:
    vertices, faces = (np.ascontiguousarray(a) for a in mesh)
    return [_cpu.Bvh(vertices, faces, accuracy, nodes=nodes) for nodes in FORMS]


def rays_at(mesh: Mesh, count: int, seed: int) -> Mesh:
    """Rays at vertices, edges and insides of triangles, from within the mesh's box, near it and far away."""
    vertices, faces = mesh
    random = np.random.default_rng(seed)
    if len(faces) == 0:
        return random_rays(count, seed)
    corners = vertices[faces[random.integers(len(faces), size=count)]].astype(np.float64)
    weights = random.dirichlet((0.3, 0.3, 0.3), count) * random.integers(2, size=(count, 3))
    weights[weights.sum(axis=1) == 0] = (1, 0, 0)
    aims = (corners * (weights / weights.sum(axis=1, keepdims=True))[:, :, None]).sum(axis=1)
    low, high = vertices.min(axis=0).astype(np.float64), vertices.max(axis=0).astype(np.float64)
    distance = np.array([0.5, 1.5, 1000.0])[np.arange(count) % 3, None]
    origins = (low + high) / 2 + distance * (high - low).max() * random.uniform(-1, 1, (count, 3))
    origins[::7, 2] = aims[::7, 2]  # some components are zero
    origins = np.clip(origins, -1e18, 1e18).astype(np.float32)
    return origins, (aims - origins).astype(np.float32)


def assert_same_answers(
    one: _cpu.Bvh, other: _cpu.Bvh, kernel: str, rays: Mesh, in_flight: int, asked: np.ndarray | None = None
) -> None:
    """Both queries give the same bits, for all rays or for the selected ones."""
    queries = [(bvh, (kernel, *rays, ZERO, INFINITE, 2, in_flight)) for bvh in (one, other)]
    (t, prim, uv, _), (other_t, other_prim, other_uv, _) = (bvh.intersect(*query) for bvh, query in queries)
    occluded, other_occluded = (bvh.occluded(*query)[0] for bvh, query in queries)
    same = (prim == other_prim) & (occluded == other_occluded)
    hit = prim >= 0
    same[hit] &= t[hit].view(np.uint32) == other_t[hit].view(np.uint32)
    same[hit] &= (uv[hit].view(np.uint32) == other_uv[hit].view(np.uint32)).all(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(~same if asked is None else ~same & asked), [])


def seen_edge_on(mesh: Mesh, bvhs: list[_cpu.Bvh], kernel: str, rays: Mesh) -> np.ndarray:
    """Whether a ray hits a triangle at less than six degrees to its plane.

    The t of "fast" is then so far off that it may lie outside the triangle's box, and the result depends on
    the order in which boxes are visited.
    """
    found = np.zeros(len(rays[0]), bool)
    for bvh in bvhs:
        prim = bvh.intersect(kernel, *rays, ZERO, INFINITE)[1]
        hit = prim >= 0
        v0, v1, v2 = mesh[0][mesh[1][prim[hit]]].astype(np.float64).swapaxes(0, 1)
        lengths = [np.linalg.norm(edge, axis=1, keepdims=True) for edge in (v1 - v0, v2 - v0)]
        normal = np.cross((v1 - v0) / lengths[0], (v2 - v0) / lengths[1])
        direction = rays[1][hit].astype(np.float64)
        direction /= abs(direction).max(axis=1, keepdims=True)
        size = np.linalg.norm(normal, axis=1) * np.linalg.norm(direction, axis=1)
        found[hit] |= abs((normal * direction).sum(axis=1)) < 0.1 * size
    return found


@pytest.mark.parametrize("kernel", CPU_BACKENDS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_hits_on_hard_meshes_are_those_of_float32_nodes(mesh: Mesh, accuracy: str, kernel: str) -> None:
    bvhs = both(mesh, accuracy)
    # Exact trees compare coincident hits in integers, which takes long.
    rays = rays_at(mesh, 300 if accuracy == "exact" else 3000, 1)
    asked = ~seen_edge_on(mesh, bvhs, kernel, rays) if accuracy == "fast" else None
    assert asked is None or asked.mean() > 0.5
    for in_flight in (1, 24):
        assert_same_answers(*bvhs, kernel, rays, in_flight, asked)


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("name", ["living_room", "city_san_francisco"])
def test_hits_in_real_scenes_are_those_of_float32_nodes(
    name: str, accuracy: str, scenes: Callable[[str], Mesh]
) -> None:
    mesh = scenes(name)
    plain, compressed = both(mesh, accuracy)
    random = np.random.default_rng(2)
    low, high = mesh[0].min(axis=0), mesh[0].max(axis=0)
    origins = (low + (high - low) * random.random((30_000, 3))).astype(np.float32)
    rays = origins, random.standard_normal(origins.shape).astype(np.float32)
    for kernel in CPU_BACKENDS:
        for in_flight in (1, 24):
            assert_same_answers(plain, compressed, kernel, rays, in_flight)


@pytest.mark.parametrize("name", ["living_room", "veach_ajar"])
def test_a_real_scene_takes_forty_bytes_a_triangle_at_most(name: str, scenes: Callable[[str], Mesh]) -> None:
    vertices, faces = scenes(name)
    bvh = _cpu.Bvh(vertices, faces, nodes="compressed")
    assert bvh.memory == 32 * len(bvh.units)
    assert bvh.memory / len(faces) <= 40
    assert bvh.nodes[0].nbytes <= 128


def test_every_box_holds_its_subtree_in_exact_arithmetic(mesh: Mesh) -> None:
    bvh = _cpu.Bvh(*mesh, nodes="compressed")
    ways = list(walk(bvh))
    lowest, highest = np.full((len(bvh.nodes), 3), np.inf), np.full((len(bvh.nodes), 3), -np.inf)
    for node, lane, reference in reversed(ways):  # children before their parents
        if reference >= LEAF:
            corners = np.concatenate([block.corners.reshape(-1, 3) for block in blocks(bvh, reference)])
            below = corners.min(axis=0), corners.max(axis=0)
        else:
            below = lowest[reference // NODE_WORDS], highest[reference // NODE_WORDS]
        low, high = exact_box(bvh, node, lane)
        assert all(low[axis] <= Fraction(float(below[0][axis])) for axis in range(3))
        assert all(high[axis] >= Fraction(float(below[1][axis])) for axis in range(3))
        lowest[node] = np.minimum(lowest[node], below[0])
        highest[node] = np.maximum(highest[node], below[1])
    assert len(ways) == (children(bvh) != NO_CHILD).sum()


def test_every_box_is_at_most_a_step_looser_than_the_float32_one() -> None:
    mesh = soup(5000, seed=7)
    plain, compressed = both(mesh, "watertight")
    low, high = decode_planes(compressed)
    used = children(compressed) != NO_CHILD
    assert np.array_equal(plain.nodes[:, 6][used] < LEAF, children(compressed)[used] < LEAF)  # the same tree
    rows = plain.nodes[:, :6].view(np.float32).astype(np.float64)
    plain_low, plain_high = rows[:, 0::2].transpose(0, 2, 1), rows[:, 1::2].transpose(0, 2, 1)
    step = np.ascontiguousarray(compressed.nodes).reshape(-1, NODE_WORDS)[:, 3:6].view(np.float32)[:, None]
    # Planes are moved outwards by the slack of the node before they are rounded to a step.
    largest = np.where(used[..., None], np.maximum(-plain_low, plain_high), 0).max(axis=(1, 2), keepdims=True)
    least, most = (np.broadcast_to(x, low.shape) for x in (16 * U * largest, 18 * U * largest + step))
    for looser in (plain_low - low, high - plain_high):
        assert (looser[used] >= least[used]).all()
        assert (looser[used] < most[used]).all()
    assert (np.frexp(step)[0] == 0.5).all()
    highest = np.where(used[..., None], high, -np.inf).max(axis=1)
    lowest = np.where(used[..., None], low, np.inf).min(axis=1)
    assert (step[:, 0] <= (highest - lowest) / 127).all()


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_blocks_hold_the_callers_triangles_bit_for_bit_each_once(mesh: Mesh, accuracy: str) -> None:
    vertices, faces = mesh
    plain, bvh = both(mesh, accuracy)
    for _, _, reference in walk(bvh):
        for block in blocks(bvh, reference) if reference >= LEAF else ():
            assert block.vertices in (6, 8)
            given = vertices[faces[block.prims]]
            assert np.array_equal(block.corners.view(np.uint32), given.view(np.uint32))
    prims = plain.blocks[:, 9].view(np.int32).ravel()
    assert all_prims(bvh) == sorted(prims[prims >= 0])


def test_order_is_that_of_the_float32_node() -> None:
    plain, compressed = both(sphere(4), "watertight")
    for octant in range(8):
        expected = plain.nodes[:, 7] >> np.uint32(4 * octant) & np.uint32(7)
        assert np.array_equal(orders(compressed) >> np.uint32(3 * octant) & np.uint32(7), expected)


@pytest.mark.parametrize("kernel", CPU_BACKENDS)
@pytest.mark.parametrize(
    "name", ["one triangle", "a flat triangle", "sphere", "soup", "tiny", "tinier", "strewn"]
)
def test_empty_lanes_are_never_hit_however_far_the_ray_starts(name: str, kernel: str) -> None:
    # From far away the slack is larger than a node, and even inverted boxes in it are hit.
    mesh = MESHES[name]()
    plain, bvh = both(mesh, "watertight")
    assert (children(bvh) == NO_CHILD).any()
    random = np.random.default_rng(8)
    aims = mesh[0][mesh[1][random.integers(len(mesh[1]), size=500)]].mean(axis=1, dtype=np.float64)
    towards = random.standard_normal((500, 3))
    distance = np.ptp(mesh[0], axis=0).max() * 10.0 ** random.uniform(2, 9, (500, 1))
    origins = (aims - towards * distance).astype(np.float32)
    rays = origins, (aims - origins).astype(np.float32)
    for in_flight in (1, 24):
        assert_same_answers(plain, bvh, kernel, rays, in_flight)
    assert (bvh.intersect(kernel, *rays, ZERO, INFINITE)[1] >= 0).mean() > 0.03
    stats = bvh.intersect(kernel, *rays, ZERO, INFINITE, stats=True)[3]
    assert stats is not None and (stats[:, 0] <= len(bvh.nodes)).all()


@pytest.mark.parametrize("kind", ["vertices", "edges"])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (148376.0, 1234.0, -223423.0), (-3e6, 2e6, 1e6)])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_closed_sphere_never_leaks(kind: str, place: tuple[float, ...], scale: float, backend: str) -> None:
    vertices, faces = sphere(4, radius=scale * (1000.0 if any(place) else 1.0))
    vertices = (vertices + scale * np.array(place)).astype(np.float32)
    random = np.random.default_rng(9)
    chosen = vertices[faces[random.integers(len(faces), size=8000)]].astype(np.float64)
    weight = random.random((len(chosen), 1)) if kind == "edges" else 1.0
    aims = chosen[:, 0] * weight + chosen[:, 1] * (1 - weight)
    middle = (vertices.min(axis=0).astype(np.float64) + vertices.max(axis=0)) / 2
    origins = np.broadcast_to(middle.astype(np.float32), aims.shape)
    directions = (aims - origins).astype(np.float32)
    scene = wive.Scene(vertices, faces, backend=backend, nodes="compressed")
    assert scene.occluded(origins, directions).all()
    assert scene.intersect(origins, directions).mask.all()


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_the_tree_does_not_depend_on_threads(accuracy: str) -> None:
    mesh = soup(60_000, seed=10, size=0.01)
    one, many = (_cpu.Bvh(*mesh, accuracy, threads=threads, nodes="compressed") for threads in (1, 5))
    assert np.array_equal(one.units, many.units)


def test_a_leaf_of_many_triangles_without_shared_vertices_is_whole() -> None:
    # Boxes with one common centre: no split lowers the cost, so leaves have their largest size.
    random = np.random.default_rng(11)
    one = random.uniform(0.999, 1.0, (400, 3)) * random.choice([-1, 1], (400, 3))
    corners = np.stack([one, -one, one * random.uniform(-1, 1, (400, 3))], axis=1).astype(np.float32)
    bvh = _cpu.Bvh(corners.reshape(-1, 3), np.arange(1200, dtype=np.int32).reshape(-1, 3), nodes="compressed")
    assert all_prims(bvh) == list(range(400))
    assert max(reference & 7 for _, _, reference in walk(bvh) if reference >= LEAF) == 7


@pytest.mark.skipif(
    _cpu.kernels()["avx512.half"] != "", reason="only AVX-512 has a kernel not made for everything"
)
def test_a_kernel_names_the_options_it_was_not_compiled_for() -> None:
    compressed, fast = _cpu.Bvh(*TRIANGLE, nodes="compressed"), _cpu.Bvh(*TRIANGLE, "fast")
    rays = *random_rays(1, 1), ZERO, INFINITE
    begin = "^kernel 'avx512.half' was not made for query "
    end = ": 'avx512', 'avx2' and 'scalar' are made for everything$"
    with pytest.raises(ValueError, match=f"{begin}'closest', accuracy 'watertight', nodes 'compressed'{end}"):
        compressed.intersect("avx512.half", *rays)
    with pytest.raises(ValueError, match=f"{begin}'count', accuracy 'fast', nodes 'float32' with stats{end}"):
        fast.count("avx512.half", *rays, stats=True)
    with pytest.raises(ValueError, match=f"{begin}'any', accuracy 'fast', nodes 'float32' with stats{end}"):
        fast.occluded("avx512.half", *rays, stats=True)


def test_scenes_keep_their_nodes_when_saved_and_pickled(tmp_path: Path) -> None:
    scene = wive.Scene(*sphere(2), nodes="compressed")
    assert scene.nodes == "compressed"
    assert scene.memory < wive.Scene(*sphere(2)).memory
    scene.save(tmp_path / "scene.npz")
    rays = random_rays(200, 1)
    for again in (wive.load(tmp_path / "scene.npz"), pickle.loads(pickle.dumps(scene))):
        assert again.nodes == "compressed"
        assert again.memory == scene.memory
        assert_same_hits(again.intersect(*rays), scene.intersect(*rays))


def test_unknown_nodes_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"^nodes must be one of float32, compressed"):
        wive.Scene(*TRIANGLE, nodes="small")
