"""An uploaded tree holds the core's boxes, orders, children and triangles, arranged for kernels."""

import dataclasses

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import random_rays, sphere

from wive import _cpu, warp_kernels

STACK = 96  # as in test_ptx_kernels.py: fewer kernels to compile
FOUR_OCTANTS = range(4)


def words_of(bvh: _cpu.Bvh) -> tuple[np.ndarray, np.ndarray]:
    """The words of the core's tree, and of the same tree after its upload."""
    uploaded = warp_kernels.upload(bvh, "cpu").units.numpy().view(np.uint32)
    return bvh.units.reshape(-1).view(np.uint32), uploaded


def behind(order: np.ndarray) -> np.ndarray:
    """For each octant and slot, a bit for each slot that comes later in an order of (octants, 8) slots."""
    masks = np.zeros(order.shape, np.uint8)
    for octant, slots in enumerate(order):
        for place, slot in enumerate(slots):
            masks[octant, slot] = sum(1 << int(later) for later in slots[place + 1 :])
    return masks


@pytest.fixture(scope="module")
def mesh() -> tuple[np.ndarray, np.ndarray]:
    return sphere(4)


def test_nodes_differ_from_the_core_in_the_order_row_alone(mesh: tuple[np.ndarray, np.ndarray]) -> None:
    bvh = _cpu.Bvh(*mesh)
    core, uploaded = words_of(bvh)
    count = 64 * len(bvh.nodes)
    np.testing.assert_array_equal(uploaded[count:], core[count:])
    nodes, found = core[:count].reshape(-1, 64), uploaded[:count].reshape(-1, 64)
    np.testing.assert_array_equal(found[:, :56], nodes[:, :56])
    for lanes, bytes_ in zip(nodes[:, 56:], found[:, 56:].copy().view(np.uint8), strict=True):
        order = np.array([lanes >> 4 * octant & 7 for octant in FOUR_OCTANTS])
        np.testing.assert_array_equal(bytes_.reshape(4, 8), behind(order))


def test_compressed_nodes_keep_boxes_orders_and_children(mesh: tuple[np.ndarray, np.ndarray]) -> None:
    bvh = _cpu.Bvh(*mesh, nodes="compressed")
    core, uploaded = words_of(bvh)
    nodes, found = (words[: 32 * len(bvh.nodes)].reshape(-1, 32) for words in (core, uploaded))
    np.testing.assert_array_equal(found[:, :3], nodes[:, :3])  # the grid's origin
    steps = [(found[:, 3] >> 8 * axis & 255) << 23 for axis in range(3)]
    np.testing.assert_array_equal(np.stack(steps, axis=1), nodes[:, 3:6])
    np.testing.assert_array_equal(found[:, 4:16], nodes[:, 6:18])  # planes
    np.testing.assert_array_equal(found[:, 24:], nodes[:, 24:])  # children
    used = (found[:, 3:4] >> np.arange(24, 32) & 1).astype(bool)
    np.testing.assert_array_equal(used, nodes[:, 24:] != 0xFFFFFFFF)
    lanes = nodes[:, 18:24].copy().view(np.uint8).reshape(-1, 8, 3).astype(np.uint32) @ [1, 1 << 8, 1 << 16]
    for packed, bytes_ in zip(lanes, found[:, 16:24].copy().view(np.uint8), strict=True):
        order = np.array([packed >> 3 * octant & 7 for octant in FOUR_OCTANTS])
        np.testing.assert_array_equal(bytes_.reshape(4, 8), behind(order))


def test_compressed_blocks_keep_vertices_corners_and_prims(mesh: tuple[np.ndarray, np.ndarray]) -> None:
    bvh = _cpu.Bvh(*mesh, nodes="compressed")
    core, uploaded = words_of(bvh)
    children = core[: 32 * len(bvh.nodes)].reshape(-1, 32)[:, 24:].ravel()
    leaves = children[(children >> 31 == 1) & (children != 0xFFFFFFFF)]
    sizes = set()
    for leaf in leaves:
        at = int(leaf & 0x7FFFFFF8)
        for _ in range(int(leaf & 7) + 1):
            count = int(core[at + 1] >> 20)
            block = uploaded[at : at + 4 * count].reshape(count, 4)
            coordinates = core[at + 2 : at + 2 + 3 * count].reshape(3, count)
            np.testing.assert_array_equal(block[:, :3], coordinates.T)
            np.testing.assert_array_equal(block[:4, 3], core[at + 2 + 3 * count :][:4])  # prims
            np.testing.assert_array_equal(block[4:6, 3], core[at : at + 2])  # header
            sizes.add(count)
            at += 4 * count
    assert sizes == {6, 8}


@pytest.mark.timeout(120)
@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_a_leaf_that_begins_with_the_last_words_is_read_within_the_allocation(
    mesh: tuple[np.ndarray, np.ndarray], nodes: str
) -> None:
    tree = dataclasses.replace(warp_kernels.upload(_cpu.Bvh(*mesh, nodes=nodes), "cpu"), stack=STACK)
    last = len(tree.units) - 8
    row = slice(48, 56) if nodes == "float32" else slice(24, 32)
    tree.units.numpy().view(np.uint32)[row] = 0x80000000 | last | 7  # eight blocks
    rays = [wp.array(values, dtype=wp.vec3, device="cpu") for values in random_rays(64, 1, -0.5, 0.5)]
    limits = [wp.array([limit], dtype=wp.float32, device="cpu") for limit in (0.0, np.inf)]
    outputs = wp.zeros(64, dtype=wp.float32, device="cpu"), wp.zeros(64, dtype=wp.int32, device="cpu")
    warp_kernels.launch_closest(tree, *rays, *limits, *outputs)
    warp_kernels.check(tree)
    room = tree.units._ref  # the array that the tree's words begin
    assert len(room) >= len(tree.units) + 2 * 40 * 8
