"""`closest_point` in users' own kernels gives the bits of the core, and refuses trees that it can't take."""

from typing import Any

import numpy as np
import pytest
from support.meshes import soup

from wive import _cpu

wp = pytest.importorskip("warp")

from wive import warp_kernels

HANDLES = {
    "fast": warp_kernels.FastBvh,
    "watertight": warp_kernels.Bvh,
    "exact": warp_kernels.ExactBvh,
}


def make_kernel(handle: Any) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False, module_options={"fuse_fp": False})
    def nearest(
        bvh: handle, points: wp.array(dtype=wp.vec3), found: wp.array(dtype=warp_kernels.ClosestPoint)
    ):
        i = wp.tid()
        found[i] = warp_kernels.closest_point(bvh, points[i], 0.3)

    return nearest


def found_by(bvh: _cpu.Bvh, points: np.ndarray) -> tuple[Any, np.ndarray]:
    tree = warp_kernels.upload(bvh, "cpu")
    found = wp.zeros(len(points), dtype=warp_kernels.ClosestPoint, device="cpu")
    inputs = [tree.handle, wp.array(points, dtype=wp.vec3, device="cpu"), found]
    wp.launch(make_kernel(HANDLES[bvh.accuracy]), len(points), inputs=inputs, device="cpu")
    return tree, found.numpy()


@pytest.mark.parametrize("accuracy", HANDLES)
def test_a_users_kernel_gets_the_bits_of_the_core(accuracy: str) -> None:
    bvh = _cpu.Bvh(*soup(1000, 1, 0.05), accuracy)
    points = np.random.default_rng(2).uniform(-0.5, 1.5, (1000, 3)).astype(np.float32)
    points[::100] = np.nan
    tree, found = found_by(bvh, points)
    warp_kernels.check(tree)
    distance, prim, uv = bvh.closest("scalar", points, np.float32([0.3]))
    assert 0 < np.count_nonzero(prim < 0) < len(prim)
    np.testing.assert_array_equal(found["distance"], distance)
    np.testing.assert_array_equal(found["prim"], prim)
    np.testing.assert_array_equal(np.stack([found["u"], found["v"]], axis=1), uv)


def test_a_compressed_tree_is_refused() -> None:
    with pytest.raises(ValueError, match="take trees with nodes 'float32', this one has 'compressed'"):
        found_by(_cpu.Bvh(*soup(100, 1), nodes="compressed"), np.zeros((3, 3), np.float32))
