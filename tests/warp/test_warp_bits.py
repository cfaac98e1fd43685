"""Bits set under comparisons: as NumPy compares, on Warp's CPU device and in the CUDA code."""

import contextlib
import shutil

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from bench.ptx import on_the_host
from bench.ptx.launching import COMPILER
from wive.warp_kernels.lanes.vectors import make_bits, make_larger, make_smaller
from wive.warp_kernels.triangles.triangle_watertight import NEGATIVE, SAME_SIGN, TIED

VALUES = np.array([-np.inf, -1.0, -1e-45, -0.0, 0.0, 1e-45, 1.0, np.inf, np.nan], np.float32)
LENGTHS = (8, 4, 1)  # of a node's lanes, of a block's, and of one thread's


def make_compare(length: int) -> tuple[wp.Kernel, type]:
    """The kernel that compares vectors of this length, and the type of the vectors."""
    vector = wp.types.vector(length=length, dtype=wp.float32)
    met = make_bits(vector, ("low", "<=", "high"))
    same_sign, tied, negative = (make_bits(vector, *signs) for signs in (SAME_SIGN, TIED, NEGATIVE))
    larger, smaller = make_larger(vector), make_smaller(vector)

    @wp.kernel(module="unique", enable_backward=False, grid_stride=False)
    def compare(
        low: wp.array(dtype=vector),
        high: wp.array(dtype=vector),
        masks: wp.array(dtype=wp.vec4ui),
        largest: wp.array(dtype=vector),
        smallest: wp.array(dtype=vector),
    ):
        i = wp.tid()
        a = low[i]
        b = high[i]
        masks[i] = wp.vec4ui(met(a, b, 0), same_sign(a, b, 0), tied(a, b, 1), negative(a, b, 2))
        largest[i] = larger(a, b)
        smallest[i] = smaller(a, b)

    return compare, vector


@pytest.mark.timeout(120)
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("cuda", [False, True])
def test_lanes_are_compared_as_numpy_compares(cuda: bool, length: int) -> None:
    if cuda and shutil.which(COMPILER[0]) is None:
        pytest.skip(f"no C++ compiler {COMPILER[0]}")
    pairs = np.stack([grid.ravel() for grid in np.meshgrid(VALUES, VALUES)])
    low, high = (
        np.random.default_rng(1).permutation(np.repeat(pairs, 8, axis=1), axis=1).reshape(2, -1, length)
    )
    kernel, vector = make_compare(length)
    given = [wp.array(rows, dtype=vector, device="cpu") for rows in (low, high)]
    masks = wp.zeros(len(low), dtype=wp.vec4ui, device="cpu")
    largest, smallest = (wp.zeros(len(low), dtype=vector, device="cpu") for _ in range(2))
    with on_the_host() if cuda else contextlib.nullcontext():
        wp.launch(kernel, len(low), given, [masks, largest, smallest], device="cpu")
    wanted = [low <= high, (low >= 0) | (high <= 0), (low == 0) | (high == 0), low < 0]
    bits = 1 << np.arange(length)
    for place, (holds, first) in enumerate(zip(wanted, (0, 0, 1, 2), strict=True)):
        np.testing.assert_array_equal(masks.numpy()[:, place], (holds * bits << first).sum(axis=1))
    numbers = ~(np.isnan(low) | np.isnan(high))
    np.testing.assert_array_equal(largest.numpy()[numbers], np.maximum(low, high)[numbers])
    np.testing.assert_array_equal(smallest.numpy()[numbers], np.minimum(low, high)[numbers])
