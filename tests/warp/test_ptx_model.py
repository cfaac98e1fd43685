"""The model of a GPU's warps counts what small kernels do as one counts it by hand."""

import shutil

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from bench.ptx.launching import COMPILER, on_the_host
from bench.ptx.model import Counts, ModelKernel, model_kernel

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(shutil.which(COMPILER[0]) is None, reason=f"no C++ compiler {COMPILER[0]}"),
]

THREADS = 64
WARPS = THREADS // 32


@wp.kernel(module="unique", enable_backward=False, grid_stride=False)
def gather(values: wp.array(dtype=wp.float32), gathered: wp.array(dtype=wp.float32), stride: int):
    i = wp.tid()
    gathered[i] = values[i * stride]


@wp.kernel(module="unique", enable_backward=False, grid_stride=False)
def sum_up(counts: wp.array(dtype=wp.int32), sums: wp.array(dtype=wp.float32)):
    i = wp.tid()
    total = sums[i]
    for k in range(counts[i]):
        total += wp.sqrt(float(k))
    sums[i] = total


def counted(kernel: wp.Kernel, *arguments: object) -> Counts:
    made: list[ModelKernel] = []

    def make(kernel: wp.Kernel, block_dim: int) -> ModelKernel:
        made.append(model_kernel(kernel, block_dim))
        made[-1].counts = Counts()
        return made[-1]

    with on_the_host(make):
        wp.launch(kernel, THREADS, list(arguments), device="cpu", block_dim=32)
    return made[-1].counts


def test_lines_are_those_that_the_lanes_of_a_warp_ask_for_at_once() -> None:
    values = wp.array(np.arange(32 * THREADS), dtype=wp.float32, device="cpu")
    gathered = wp.zeros(THREADS, dtype=wp.float32, device="cpu")
    apart = counted(gather, values, gathered, 32)
    np.testing.assert_array_equal(gathered.numpy(), values.numpy()[::32])
    assert apart.lines == apart.sectors == apart.missed_sectors == THREADS
    together = counted(gather, values, gathered, 1)
    assert WARPS <= together.lines <= 2 * WARPS  # two if the array does not begin with a line
    assert apart.instructions == together.instructions
    assert apart.active_lanes == 32


def test_lanes_that_have_left_a_loop_wait_for_the_others() -> None:
    steps = np.zeros(THREADS, np.int32)
    sums = wp.zeros(THREADS, dtype=wp.float32, device="cpu")
    none = counted(sum_up, wp.array(steps, device="cpu"), sums)
    steps[::32] = 1000
    one = counted(sum_up, wp.array(steps, device="cpu"), sums)
    steps[:] = 1000
    all_ = counted(sum_up, wp.array(steps, device="cpu"), sums)
    assert one.active_lanes < 2 < 30 < all_.active_lanes
    # What a warp issues depends on its longest lane.
    assert none.instructions * 10 < one.instructions == all_.instructions
