"""Bits set under comparisons: as NumPy compares, on Warp's CPU device and in the CUDA code."""

import contextlib
import shutil

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from bench.ptx import on_the_host
from bench.ptx.launching import COMPILER
from wive.warp_kernels.traversal.slabs import with_bit_if_met
from wive.warp_kernels.triangles.triangle_watertight import (
    with_bit_if_inside,
    with_bit_if_negative,
    with_bit_if_tied,
)

VALUES = np.array([-np.inf, -1.0, -1e-45, -0.0, 0.0, 1e-45, 1.0, np.inf, np.nan], np.float32)


@wp.kernel(module="unique", enable_backward=False, grid_stride=False)
def set_bits(
    low: wp.array(dtype=wp.float32), high: wp.array(dtype=wp.float32), masks: wp.array(dtype=wp.uint32)
):
    i = wp.tid()
    mask = with_bit_if_met(wp.uint32(16), wp.uint32(1), low[i], high[i])
    mask = with_bit_if_inside(mask, wp.uint32(2), low[i], high[i])
    mask = with_bit_if_tied(mask, wp.uint32(4), low[i], high[i])
    masks[i] = with_bit_if_negative(mask, wp.uint32(8), low[i])


@pytest.mark.timeout(120)
@pytest.mark.parametrize("cuda", [False, True])
def test_bits_are_set_as_numpy_compares(cuda: bool) -> None:
    if cuda and shutil.which(COMPILER[0]) is None:
        pytest.skip(f"no C++ compiler {COMPILER[0]}")
    low, high = (grid.ravel() for grid in np.meshgrid(VALUES, VALUES))
    given = [wp.array(values, dtype=wp.float32, device="cpu") for values in (low, high)]
    masks = wp.zeros(len(low), dtype=wp.uint32, device="cpu")
    with on_the_host() if cuda else contextlib.nullcontext():
        wp.launch(set_bits, len(low), given, [masks], device="cpu")
    wanted = (
        16
        + 1 * (low <= high)
        + 2 * ((low >= 0) | (high <= 0))
        + 4 * ((low == 0) | (high == 0))
        + 8 * (low < 0)
    )
    np.testing.assert_array_equal(masks.numpy(), wanted)
