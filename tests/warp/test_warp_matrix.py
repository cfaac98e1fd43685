"""Every query, accuracy and backend on the same rays: the Warp forms answer bit for bit as the C++ core."""

import dataclasses
import itertools
from collections.abc import Callable

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.hard_rays import HARD_MESHES, hard_rays
from support.meshes import random_rays, soup, sphere
from support.warp_launches import INFINITE, STACK, ZERO, assert_bit_identical, cpu_answers, warp_answers

import wive
from wive import _cpu, warp_kernels

pytestmark = pytest.mark.timeout(120)

HITS = ("t", "prim", "uv", "occluded", "counts", "offsets", "all_t", "all_prim", "all_uv")
CPU_KERNELS = [name for name, reason in _cpu.kernels().items() if not reason and "." not in name]
ACCURACIES = ("fast", "watertight", "exact")
FORMS = ("float32", "compressed")
Mesh = tuple[np.ndarray, np.ndarray]


def inside(vertices: np.ndarray, count: int, seed: int) -> Mesh:
    """Rays from random points of a mesh's box, in random directions."""
    origins, directions = random_rays(count, seed, 0.0, 1.0)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return (low + (high - low) * origins).astype(np.float32), directions


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize(
    ("scene", "nodes"), [("staircase", "float32"), ("living_room", "float32"), ("living_room", "compressed")]
)
def test_every_backend_gives_the_same_bits_on_real_scenes(
    scene: str, nodes: str, accuracy: str, scenes: Callable[[str], Mesh]
) -> None:
    vertices, faces = scenes(scene)
    bvh = _cpu.Bvh(
        np.ascontiguousarray(vertices, np.float32),
        np.ascontiguousarray(faces, np.int32),
        accuracy,
        nodes=nodes,
    )
    origins, directions = inside(vertices, 20_000, 1)
    reference = cpu_answers(bvh, "scalar", origins, directions)
    assert (reference.prim >= 0).mean() > 0.5
    for kernel in CPU_KERNELS:
        assert_bit_identical(cpu_answers(bvh, kernel, origins, directions), reference, HITS)
    assert_bit_identical(warp_answers(bvh, 8, origins, directions), reference)
    few = slice(0, 1500)  # fibers are slow
    one_lane = warp_answers(bvh, 1, origins[few], directions[few])
    assert_bit_identical(one_lane, cpu_answers(bvh, "scalar", origins[few], directions[few]))


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_limits_at_a_returned_t_are_compared_with_the_t_that_is_returned(accuracy: str) -> None:
    """With directions of ordinary length, and so long or short that t under- or overflows."""
    bvh = _cpu.Bvh(*sphere(2), accuracy)
    origins, directions = random_rays(300, 12, -0.5, 0.5)
    lengths = np.exp2(np.random.default_rng(13).choice([-128, -100, 0, 80, 125], (300, 1)))
    rays = origins, (directions * lengths).astype(np.float32)
    t = cpu_answers(bvh, "scalar", *rays).t
    assert (t < 2.0**-126).any() and np.isinf(t).any()
    for limits in ((t, t), (t, np.full_like(t, np.inf)), (np.zeros_like(t), t)):
        reference = cpu_answers(bvh, "scalar", *rays, *limits)
        assert reference.occluded.all() and (reference.t == t).all()
        for kernel in CPU_KERNELS:
            assert_bit_identical(cpu_answers(bvh, kernel, *rays, *limits), reference, HITS)
        for lanes in (8, 1):
            assert_bit_identical(warp_answers(bvh, lanes, *rays, *limits), reference)


@pytest.mark.parametrize("nodes", FORMS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("count", [1, 3, 13, 101])
def test_partial_blocks_give_the_hits_of_full_ones(count: int, accuracy: str, nodes: str) -> None:
    bvh = _cpu.Bvh(*soup(3000, 2), accuracy, nodes=nodes)
    origins, directions = random_rays(count, 3)
    reference = cpu_answers(bvh, "scalar", origins, directions)
    for lanes in (8, 1):
        assert_bit_identical(warp_answers(bvh, lanes, origins, directions), reference)


@pytest.mark.parametrize("block_dim", [8, 24, 128])
def test_block_size_does_not_change_the_answer(block_dim: int) -> None:
    """Of the closest hit: a block's groups and their stacks are those of every query."""
    bvh = _cpu.Bvh(*soup(3000, 2))
    origins, directions = random_rays(101, 4, 0.0, 1.0)
    tree = dataclasses.replace(warp_kernels.upload(bvh, "cpu"), stack=STACK)
    rays = [wp.array(a, dtype=wp.vec3, device="cpu") for a in (origins, directions)]
    rays += [wp.array(a, dtype=wp.float32, device="cpu") for a in (ZERO, INFINITE)]
    t, prim = (wp.zeros(101, dtype=dtype, device="cpu") for dtype in (wp.float32, wp.int32))
    warp_kernels.launch_closest(tree, *rays, t, prim, lanes=1, block_dim=block_dim)
    warp_kernels.check(tree)
    expected = cpu_answers(bvh, "scalar", origins, directions)
    assert (expected.prim >= 0).any()
    np.testing.assert_array_equal(prim.numpy(), expected.prim)
    np.testing.assert_array_equal(t.numpy(), expected.t)


@pytest.mark.parametrize("lanes", [8, 1])
def test_groups_of_a_block_diverge(lanes: int) -> None:
    """In one block: rays that miss at once, refused rays, short intervals and rays through everything."""
    bvh = _cpu.Bvh(*soup(6000, 5))
    origins, directions = random_rays(160, 6, 0.0, 1.0)
    origins[::5] = 1e6
    directions[1::5] = np.nan
    tmax = np.where(np.arange(160) % 5 == 2, 1e-3, np.inf).astype(np.float32)
    tmin = np.where(np.arange(160) % 5 == 3, 0.5, -np.inf).astype(np.float32)
    reference = cpu_answers(bvh, "scalar", origins, directions, tmin, tmax)
    assert len(np.unique(reference.steps[:, 0])) > 10
    assert_bit_identical(warp_answers(bvh, lanes, origins, directions, tmin, tmax), reference)


@pytest.mark.parametrize("nodes", FORMS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("mesh", HARD_MESHES)
def test_hard_rays_give_the_same_bits_in_every_form(mesh: str, accuracy: str, nodes: str) -> None:
    vertices, faces = HARD_MESHES[mesh]()
    bvh = _cpu.Bvh(vertices, faces, accuracy, nodes=nodes)
    origins, directions = hard_rays(vertices, faces) if len(faces) else random_rays(50, 8)
    tmin = np.full(1, -np.inf, np.float32)  # also behind the origin: t of either sign
    reference = cpu_answers(bvh, "scalar", origins, directions, tmin)
    for lanes in (8, 1):
        assert_bit_identical(warp_answers(bvh, lanes, origins, directions, tmin), reference)


@pytest.mark.parametrize("nodes", FORMS)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_rays_that_touch_the_box_of_the_tree_keep_their_hits(accuracy: str, nodes: str) -> None:
    """Kernels without counters do not trace rays that miss this box."""
    for mesh in ("sphere", "sphere far away", "integer grid", "one triangle", "empty"):
        vertices, faces = HARD_MESHES[mesh]()
        origins, directions = hard_rays(vertices, faces) if len(faces) else random_rays(50, 8)
        corners = np.array(
            list(itertools.product(*zip(vertices.min(axis=0), vertices.max(axis=0), strict=True)))
        )
        sides = corners[:, None] - corners
        origins = np.concatenate([origins, np.repeat(corners, 8, axis=0) - 3 * sides.reshape(-1, 3)])
        directions = np.concatenate([directions, sides.reshape(-1, 3)])
        scene, core = (
            wive.Scene(vertices, faces, accuracy=accuracy, nodes=nodes, **options)
            for options in ({"device": "cpu"}, {"backend": "scalar"})
        )
        usual = core.intersect(origins, directions)
        assert (usual.prim >= 0).any() == (len(faces) > 0)
        for tmin in (0.0, -np.inf, np.where(usual.prim >= 0, usual.t, 0)):
            found, wanted = (one.intersect(origins, directions, tmin=tmin) for one in (scene, core))
            for name in ("t", "prim", "uv"):
                np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=mesh)


@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_rays_in_a_side_of_the_box_of_the_tree_keep_their_hits(accuracy: str) -> None:
    """A flat mesh: rays start at its hits, and one runs almost within the plane of a side of its box."""
    flat = np.float32([[-0.9, -0.9, 0.9], [0.9, -0.9, 0.9], [0, 0.9, 0.9]])
    long = np.float32([[0, -6440.43115234375, 1], [0, -4203.7109375, 1], [0, -7034.26123046875, 0]])
    random = np.random.default_rng(8)
    aims = random.uniform([-0.3, -0.3, 0.5], [0.3, 0.3, 1.0], (400, 3)).astype(np.float32)
    one = np.float32([[-0.676872968673706, -0.0005970357451587915, 0.9999957084655762]])
    way = np.float32([[0.676872968673706, -5831.5732421875, 1.4691261540633604e-08]])
    for vertices, origins, directions in ((flat, np.zeros_like(aims), aims), (long, one, way)):
        scene, core = (
            wive.Scene(vertices, [[0, 1, 2]], accuracy=accuracy, **options)
            for options in ({"device": "cpu"}, {"backend": "scalar"})
        )
        usual = core.intersect(origins, directions)
        assert (usual.prim >= 0).any()
        for tmin in (0.0, np.where(usual.prim >= 0, usual.t, 0)):
            found, wanted = (one.intersect(origins, directions, tmin=tmin) for one in (scene, core))
            np.testing.assert_array_equal(found.prim, wanted.prim)
            np.testing.assert_array_equal(found.t, wanted.t)


def test_empty_and_exact_intervals_are_kept_to() -> None:
    bvh = _cpu.Bvh(*HARD_MESHES["one triangle"]())
    origins = np.tile(np.float32([0.25, 0.25, 0]), (6, 1))
    directions = np.tile(np.float32([0, 0, 1]), (6, 1))
    tmin = np.float32([0, 1, 2, 1, 0, np.nan])
    tmax = np.float32([1, 1, 1, 0, 0.999, 5])
    for lanes in (8, 1):
        found = warp_answers(bvh, lanes, origins, directions, tmin, tmax)
        np.testing.assert_array_equal(found.prim, [0, 0, -1, -1, -1, -1])
        np.testing.assert_array_equal(found.occluded, [True, True, False, False, False, False])


@pytest.mark.parametrize("lanes", [8, 1])
def test_closed_sphere_never_leaks_at_vertices_and_edges(lanes: int) -> None:
    vertices, faces = sphere(4)
    shift = np.float32([148376, 1234, -223423])
    middles = vertices[faces][:, :2].mean(axis=1)
    for offset in (np.float32([0, 0, 0]), shift):
        moved = vertices + offset
        aims = np.concatenate([moved, (middles + offset).astype(np.float32)])
        if lanes == 1:
            aims = aims[::10]
        origins = np.tile(offset, (len(aims), 1))
        found = warp_answers(_cpu.Bvh(moved, faces), lanes, origins, aims - origins)
        assert (found.prim >= 0).all() and found.occluded.all()
