"""The runner of PTX sees the faults that a GPU would run without a word: planted ones are reported."""

import dataclasses
import re
import shutil
from collections.abc import Callable

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import random_rays, soup
from support.warp_launches import INFINITE, ZERO

from bench.ptx import HostKernel, MachineError, on_the_host
from bench.ptx.instructions import rule_of
from bench.ptx.launching import COMPILER, ptx_of
from wive import _cpu, warp_kernels
from wive.warp_kernels.launching.kernels import make_kernel
from wive.warp_kernels.launching.launch import default_block_dim

pytestmark = [
    pytest.mark.timeout(120),
    pytest.mark.skipif(shutil.which(COMPILER[0]) is None, reason=f"no C++ compiler {COMPILER[0]}"),
]

RAYS, LIMITS = random_rays(64, 2, 0.0, 1.0), (ZERO, INFINITE)
STACK = 96  # as in test_warp_cuda_aot.py, so that the kernel is compiled to PTX once


def trace(changed: Callable[[str], str]) -> np.ndarray:
    """The prims of rays through a soup, by the PTX of eight threads per ray with a change."""
    kernel = make_kernel("closest", "watertight", 1, STACK)
    ptx = ptx_of(kernel, default_block_dim(1))
    changed_ptx = changed(ptx)
    assert changed_ptx != ptx
    broken = HostKernel(changed_ptx, f"{kernel.get_mangled_name()}_cuda_kernel_forward")
    tree = dataclasses.replace(warp_kernels.upload(_cpu.Bvh(*soup(3000, 1)), "cpu"), stack=STACK)
    rays = [wp.array(values, dtype=wp.vec3, device="cpu") for values in RAYS]
    limits = [wp.array(values, dtype=wp.float32, device="cpu") for values in LIMITS]
    t, prim = wp.zeros(64, dtype=wp.float32, device="cpu"), wp.zeros(64, dtype=wp.int32, device="cpu")
    with on_the_host(lambda kernel, block_dim: broken):
        warp_kernels.launch_closest(tree, *rays, *limits, t, prim, lanes=1)
    return prim.numpy()


def without_sync(place: int) -> Callable[[str], str]:
    """Drops the bar.warp.sync at that place of the text."""

    def changed(ptx: str) -> str:
        found = list(re.finditer(r"bar\.warp\.sync[^;]*;", ptx))
        return ptx[: found[place].start()] + ptx[found[place].end() :]

    return changed


def with_operand(opcode: str, place: int, operand: str) -> Callable[[str], str]:
    """Replaces an operand of every instruction of that opcode; the first is what it writes."""

    def changed(ptx: str) -> str:
        def plant(instruction: re.Match[str]) -> str:
            operands = instruction[2].split(", ")
            operands[place] = operand
            return instruction[1] + ", ".join(operands) + ";"

        return re.sub(rf"({re.escape(opcode)}\s+)([^;]*);", plant, ptx)

    return changed


@pytest.mark.parametrize("place", range(4))
def test_a_dropped_barrier_is_a_race(place: int) -> None:
    """Before and behind the fetch of a ray, behind the pushes of a node, and at the end of a step."""
    with pytest.raises(MachineError, match=r"race: .* of shared memory"):
        trace(without_sync(place))


def test_a_mask_of_other_threads_is_refused() -> None:
    with pytest.raises(MachineError, match="mask 000000ff does not name its own lane"):
        trace(with_operand("vote.sync.ballot.b32", 2, "255"))


def test_a_shuffle_between_rays_is_a_race() -> None:
    """Threads that know another ray's distance take other children than the rest of their own."""
    with pytest.raises(MachineError, match=r"race: .* of shared memory"):
        trace(with_operand("shfl.sync.bfly.b32", 2, "8"))


@pytest.mark.parametrize(
    "opcode", ["add.ftz.f32", "div.approx.f32", "fma.rz.f32", "cvt.rz.f32.f64", "shfl.sync.b32"]
)
def test_instructions_that_are_not_known_are_refused(opcode: str) -> None:
    with pytest.raises(ValueError, match=f"unknown instruction {opcode}"):
        rule_of(opcode)
