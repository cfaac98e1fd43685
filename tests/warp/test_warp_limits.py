"""A tree whose memory was overwritten ends in an error, never in a hang; stacks suffice for any tree."""

import dataclasses

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import random_rays, soup, sphere

from wive import _cpu, warp_kernels
from wive.warp_kernels.tree import tree as trees

pytestmark = [pytest.mark.timeout(60), pytest.mark.usefixtures("one_stack_size")]


def launch_all(tree: warp_kernels.Tree, lanes: warp_kernels.launching.launch.Lanes) -> np.ndarray:
    """Every query; the closest hits, or -1 for a ray for which any of them found nothing."""
    origins, directions = random_rays(64, 1, -0.5, 0.5)
    rays = [wp.array(a, dtype=wp.vec3, device="cpu") for a in (origins, directions)]
    rays += [wp.zeros(1, dtype=wp.float32, device="cpu"), wp.full(1, 1e30, dtype=wp.float32, device="cpu")]
    t, prim = wp.zeros(64, dtype=wp.float32, device="cpu"), wp.zeros(64, dtype=wp.int32, device="cpu")
    warp_kernels.launch_closest(tree, *rays, t, prim, None, lanes=lanes)
    occluded = wp.zeros(64, dtype=wp.bool, device="cpu")
    warp_kernels.launch_any(tree, *rays, occluded, lanes=lanes)
    counts = wp.zeros(64, dtype=wp.int32, device="cpu")
    warp_kernels.launch_count(tree, *rays, counts, lanes=lanes)
    found = occluded.numpy() & (counts.numpy() > 0)
    return np.where(found, prim.numpy(), -1)


def corrupt(tree: warp_kernels.Tree, child: int) -> None:
    """Point every child of the root at `child`."""
    tree.units.numpy().view(np.uint32)[48:56] = child


@pytest.mark.parametrize("lanes", [8, 1])
@pytest.mark.parametrize(
    ("what", "child"), [("a cycle", 0), ("out of bounds", 0x7FFFFFF8), ("a leaf out of bounds", 0xFFFFFFF7)]
)
def test_corrupt_tree_raises_instead_of_hanging(
    what: str, child: int, lanes: warp_kernels.launching.launch.Lanes
) -> None:
    tree = warp_kernels.upload(_cpu.Bvh(*sphere(2)), "cpu")
    assert (launch_all(tree, lanes) >= 0).all()
    warp_kernels.check(tree)
    corrupt(tree, child)
    launch_all(tree, lanes)
    with pytest.raises(warp_kernels.CorruptTreeError, match="left the tree or did not end"):
        warp_kernels.check(tree)
    # Later rays give up at once, and miss.
    assert (launch_all(tree, lanes) == -1).all()


@pytest.mark.parametrize("lanes", [8, 1])
def test_hits_that_were_counted_but_are_no_longer_found_are_misses(
    lanes: warp_kernels.launching.launch.Lanes,
) -> None:
    tree = warp_kernels.upload(_cpu.Bvh(*sphere(2)), "cpu")
    origins, directions = random_rays(64, 1, -0.5, 0.5)
    rays = [wp.array(a, dtype=wp.vec3, device="cpu") for a in (origins, directions)]
    rays += [wp.zeros(1, dtype=wp.float32, device="cpu"), wp.full(1, 1e30, dtype=wp.float32, device="cpu")]
    counts = wp.zeros(64, dtype=wp.int32, device="cpu")
    warp_kernels.launch_count(tree, *rays, counts, lanes=lanes)
    promised = wp.array(np.where(np.arange(64) % 2, 0, 3).astype(np.int32), device="cpu")  # one is found
    offsets = warp_kernels.scan_counts(promised)
    listed = [wp.zeros(96, dtype=dtype, device="cpu") for dtype in (wp.float32, wp.int32, wp.vec2)]
    warp_kernels.launch_all(tree, *rays, promised, offsets, *listed, lanes=lanes)
    np.testing.assert_array_equal(counts.numpy(), 1)
    prim = listed[1].numpy().reshape(32, 3)
    assert (prim[:, 0] >= 0).all() and (prim[:, 1:] == -1).all()
    assert np.isinf(listed[0].numpy().reshape(32, 3)[:, 1:]).all()


def test_kernels_have_the_smallest_stack_that_the_tree_cannot_overflow(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for mesh in (sphere(2), soup(3000, 2)):
        needed = warp_kernels.upload(_cpu.Bvh(*mesh), "cpu").batch_handle.stack
        for sizes, chosen in (((8, needed, 512), needed), ((8, needed - 1, 500, 512), 500)):
            monkeypatch.setattr(trees, "STACK_SIZES", sizes)
            assert warp_kernels.upload(_cpu.Bvh(*mesh), "cpu").stack == chosen


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_a_stack_of_the_size_that_a_tree_needs_is_enough(nodes: str) -> None:
    bvh = _cpu.Bvh(*soup(3000, 2, size=0.9), nodes=nodes)
    tree = warp_kernels.upload(bvh, "cpu")
    origins, directions = random_rays(200, 1, 0, 1)
    rays = [wp.array(a, dtype=wp.vec3, device="cpu") for a in (origins, directions)]
    rays += [wp.zeros(1, dtype=wp.float32, device="cpu"), wp.full(1, 1e30, dtype=wp.float32, device="cpu")]
    counts = wp.zeros(200, dtype=wp.int32, device="cpu")
    warp_kernels.launch_count(dataclasses.replace(tree, stack=tree.batch_handle.stack), *rays, counts)
    warp_kernels.check(tree)
    expected, _ = bvh.count("scalar", origins, directions, np.zeros(1, np.float32), np.float32([1e30]))
    np.testing.assert_array_equal(counts.numpy(), expected)
