"""The suite detects faults: usual mistakes, planted in NumPy copies of the arithmetic, make rays leak.

The copies follow frame.h, slabs.h and triangle_watertight.h operation by operation in float32, so
they also give the triangles that the compiled kernels must report.
"""

import functools

import numpy as np
import pytest
from support.closed_meshes import leaving, placed
from support.meshes import sphere

import wive
from wive import _cpu

Mesh = tuple[np.ndarray, np.ndarray]
LEAF = 1 << 31
SLACK = np.float32(2.0**-20)
PLANE_SLACK = np.float32(17 * 2.0**-24)  # cpu/build/write_node.h


def edge_function(a: np.ndarray, b: np.ndarray, fused: bool) -> np.ndarray:
    """a_x b_y - a_y b_x of moved corners (n,2) float32; fused: the first product is not rounded."""
    second = a[:, 1] * b[:, 0]
    if fused:
        return a[:, 0].astype(np.float64) * b[:, 1] - second
    return a[:, 0] * b[:, 1] - second


def moved_corners(corners: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Corners (n,k,3) in the space in which the ray is the z axis: (k,n,2)."""
    order = (np.argmax(np.abs(directions), axis=1)[:, None] + [1, 2, 3]) % 3
    ray = np.take_along_axis(directions, order, axis=1)
    away = np.take_along_axis(corners - origins[:, None], order[:, None], axis=2)
    shear = ray[:, :2] / ray[:, 2:]
    return (away[..., :2] - shear[:, None] * away[..., 2:]).swapaxes(0, 1)


def accepts(
    corners: np.ndarray, origins: np.ndarray, directions: np.ndarray, fused: bool = False
) -> np.ndarray:
    """Whether each line passes the watertight test of its triangle (n,3,3)."""
    p = moved_corners(corners, origins, directions)
    pairs = [(p[2], p[1]), (p[0], p[2]), (p[1], p[0])]
    edges = np.stack([edge_function(a, b, fused) for a, b in pairs]).astype(np.float64)
    exactly = np.stack([edge_function(a.astype(np.float64), b.astype(np.float64), False) for a, b in pairs])
    tied = (edges == 0).any(axis=0)
    edges[:, tied] = exactly[:, tied]
    return (edges < 0).any(axis=0) != (edges > 0).any(axis=0)


@functools.cache
def at_edges() -> tuple[Mesh, Mesh, np.ndarray, np.ndarray]:
    """A closed sphere, rays from inside at points of its edges, and the two triangles there (n,2)."""
    vertices, faces = placed(sphere(4), 100.0, (1000.0, -300.0, 70.0))
    random = np.random.default_rng(61)
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    owner = {tuple(side): number // 3 for number, side in enumerate(sides.tolist())}
    chosen = sides[random.integers(len(sides), size=40_000)]
    both = np.array([[owner[a, b], owner[b, a]] for a, b in chosen.tolist()])
    weight = random.uniform(0.05, 0.95, (len(chosen), 1))
    ends = vertices[chosen].astype(np.float64)
    targets = ends[:, 0] * weight + ends[:, 1] * (1 - weight)
    origins = (vertices.mean(axis=0) + 30 * random.uniform(-1, 1, targets.shape)).astype(np.float32)
    return (vertices, faces), (origins, (targets - origins).astype(np.float32)), both, chosen


def accepted_of_both(fused: bool) -> np.ndarray:
    """(n,2) whether each ray passes the test of either triangle at its edge."""
    (vertices, faces), rays, both, _ = at_edges()
    return np.stack([accepts(vertices[faces[both[:, k]]], *rays, fused) for k in (0, 1)], axis=1)


def test_edge_functions_agree_from_both_sides_unless_fused() -> None:
    (vertices, _), rays, _, edges = at_edges()
    a, b = moved_corners(vertices[edges], *rays)
    assert np.array_equal(edge_function(a, b, False), -edge_function(b, a, False))
    one, other = edge_function(a, b, True), edge_function(b, a, True)
    assert (np.sign(one) == np.sign(other)).sum() > 100


def test_a_fused_edge_function_would_leak_on_these_rays() -> None:
    assert accepted_of_both(fused=False).any(axis=1).all()
    assert not accepted_of_both(fused=True).any(axis=1).all()


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_kernels_hit_the_triangles_that_unfused_arithmetic_accepts(backend: str, nodes: str) -> None:
    (vertices, faces), rays, both, _ = at_edges()
    found = wive.Scene(vertices, faces, backend=backend, nodes=nodes).intersect_all(*rays, touching=True)
    reported = found.prim.astype(np.int64) + len(faces) * np.repeat(
        np.arange(len(both)), np.diff(found.offsets)
    )

    def pairs(accepted: np.ndarray) -> np.ndarray:
        ray, side = np.nonzero(accepted)
        return np.sort(both[ray, side] + len(faces) * ray)

    np.testing.assert_array_equal(np.sort(reported), pairs(accepted_of_both(fused=False)))
    # Kernels whose products were fused would be seen here.
    fused = pairs(accepted_of_both(fused=True))
    assert len(np.setxor1d(fused, reported)) > 100


def boxes_above(bvh: _cpu.Bvh, triangles: int) -> np.ndarray:
    """(f,d) for each triangle the slots (node * 8 + lane) from the root to its leaf, -1 below it."""
    nodes, prims = bvh.nodes, bvh.blocks[:, 9].view(np.int32)
    planes = nodes[:, :6].view(np.float32)
    chains = np.full((triangles, bvh.depth + 1), -1)
    todo: list[tuple[int, tuple[int, ...]]] = [(0, ())]
    while todo:
        node, chain = todo.pop()
        for lane in np.flatnonzero(planes[node, 0] <= planes[node, 1]):
            child = int(nodes[node, 6, lane])
            unit, below = (child & ~LEAF) >> 3, (*chain, node * 8 + int(lane))
            if not child & LEAF:
                todo.append((unit // 8, below))
                continue
            first = (unit - 8 * len(nodes)) // 5
            held = prims[first : first + (child & 7) + 1]
            chains[held[held >= 0], : len(below)] = below
    return chains


def reached(
    bvh: _cpu.Bvh, slots: np.ndarray, origins: np.ndarray, directions: np.ndarray, slack: np.float32
) -> np.ndarray:
    """Whether the slab test of each ray hits all boxes (n,d) on its way; slots of -1 count as hit.

    slack: that of the rays, per size of the origin; if it is 0, that of the planes is taken out as well.
    """
    lo, hi = (
        bvh.nodes[:, rows].view(np.float32).transpose(0, 2, 1).reshape(-1, 3)[slots]
        for rows in ([0, 2, 4], [1, 3, 5])
    )
    if slack == 0:
        inwards = np.maximum(-lo, hi).max(axis=-1, keepdims=True) * PLANE_SLACK
        lo, hi = lo + inwards, hi - inwards
    longest = np.abs(directions).max(axis=1, keepdims=True)
    scaled = np.ldexp(directions, 1 - np.frexp(longest)[1]).astype(np.float32)
    relative = origins - bvh.center
    magnitude = np.abs(relative).max(axis=1, keepdims=True)
    size = np.float32(1) / np.maximum(
        np.abs(scaled), np.abs(scaled).max(axis=1, keepdims=True) * np.float32(2.0**-30)
    )
    r = np.copysign(size, scaled)
    distance, wider = relative * r, size * (magnitude * slack)
    near, far = np.where(r[:, None] < 0, hi, lo), np.where(r[:, None] < 0, lo, hi)
    enter = (near * r[:, None] + -(distance + wider)[:, None]).max(axis=2).clip(min=0)
    leave = (far * r[:, None] + (wider - distance)[:, None]).min(axis=2)
    return ((enter <= leave) | (slots < 0)).all(axis=1)


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (148376.0, 1234.0, -223423.0)])
def test_slabs_without_their_slack_would_lose_triangles(place: tuple[float, ...]) -> None:
    vertices, faces = mesh = placed(sphere(4), 1000.0, place)
    bvh = _cpu.Bvh(*mesh)
    chains = boxes_above(bvh, len(faces))
    assert (chains[:, 0] >= 0).all()
    vertex = faces.ravel()
    around = np.argsort(vertex, kind="stable") // 3
    starts = np.searchsorted(np.sort(vertex), np.arange(len(vertices) + 1))
    random = np.random.default_rng(62)
    aims = random.integers(len(vertices), size=20_000)
    origins = (vertices.mean(axis=0) + 400 * random.uniform(-1, 1, (len(aims), 3))).astype(np.float32)
    directions = vertices[aims] - origins
    near = starts[aims + 1] - starts[aims]
    ray = np.repeat(np.arange(len(aims)), near)
    triangle = around[np.concatenate([np.arange(starts[v], starts[v + 1]) for v in aims])]
    accepted = accepts(vertices[faces[triangle]], origins[ray], directions[ray])
    ray, triangle = ray[accepted], triangle[accepted]
    assert len(np.unique(ray)) == len(aims)
    pairs = bvh, chains[triangle], origins[ray], directions[ray]
    assert reached(*pairs, SLACK).all()
    lost = ~reached(*pairs, np.float32(0))
    assert lost.any()
    # The kernels lose none of them.
    usable = [name for name, reason in _cpu.kernels().items() if not reason]
    for kernel in usable:
        limits = np.zeros(1, np.float32), np.full(1, np.inf, np.float32)
        offsets, _, prim, _, _ = bvh.intersect_all(kernel, origins, directions, *limits, touching=True)
        found = prim.astype(np.int64) + len(faces) * np.repeat(np.arange(len(aims)), np.diff(offsets))
        assert np.isin(triangle + len(faces) * ray, found).all()


def test_fast_mode_leaks_on_the_rays_of_the_hard_cases() -> None:
    random = np.random.default_rng(63)
    leaks = dict.fromkeys(("fast", "watertight", "exact"), 0)
    for level, scale, place in ((1, 1.0, (0, 0, 0)), (4, 1e-3, (1, 2, 3)), (4, 100.0, (5e4, -3e4, 2e4))):
        mesh = placed(sphere(level), scale, place)
        rays = leaving(mesh, 20_000, random)
        for accuracy in leaks:
            leaks[accuracy] += int((~wive.Scene(*mesh, accuracy=accuracy).occluded(*rays)).sum())
    assert leaks["fast"] > 10
    assert leaks["watertight"] == leaks["exact"] == 0
