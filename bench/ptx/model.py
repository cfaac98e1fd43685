"""Counts of what a GPU's warps do in a launch, from PTX that runs on the host (model.cpp).

A model, not a measurement: instructions of PTX, not of the assembler; lanes meet where compilers let them; a
number of warps take turns at an L1 cache that keeps the lines used last; nothing has a latency.
"""

import ctypes
import functools
from dataclasses import dataclass, fields
from typing import Any

import warp as wp

from bench.ptx.blocks import meeting_places
from bench.ptx.launching import ERROR_BYTES, MachineError, build, machine, ptx_of
from bench.ptx.translation import translate

RESIDENT_WARPS = 24  # per multiprocessor, at 80 registers per thread
L1_LINES = 192 * 1024 // 128


@dataclass
class Counts:
    """What all warps of the launches did."""

    instructions: int = 0  # that a warp issued, for however many lanes
    lane_instructions: int = 0
    lines: int = 0  # of 128 bytes that loads asked for, each request of a warp for itself
    sectors: int = 0  # of 32 bytes
    missed_sectors: int = 0  # of these, not in L1
    local_lines: int = 0  # of local memory, written or read
    local_missed_sectors: int = 0

    @property
    def active_lanes(self) -> float:
        """Lanes active in an instruction, of 32."""
        return self.lane_instructions / max(1, self.instructions)


class _Counts(ctypes.Structure):
    _fields_ = [(field.name, ctypes.c_uint64) for field in fields(Counts)]


class _Blocks(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("length", "function", "meeting")]


class ModelKernel:
    """A kernel to be launched by `on_the_host` that counts instead of checking for faults."""

    def __init__(self, ptx: str, name: str) -> None:
        """Build the kernel of that name in PTX text."""
        library = machine()
        self._model = library.ptx_model
        program = translate(ptx, name, traced=True)
        self._entry = ctypes.cast(build(program.text, "-O1").ptx_entry, ctypes.c_void_p)
        self._shared_bytes = program.shared_bytes
        count, blocks = len(program.blocks), program.blocks
        self._arrays = (
            (ctypes.c_uint32 * count)(*(block.length for block in blocks)),
            (ctypes.c_int32 * count)(*(block.function for block in blocks)),
            (ctypes.c_int32 * count)(*meeting_places(blocks)),
        )
        self.counts = Counts()

    def run(self, arguments: list[Any], blocks: int, block_dim: int, seed: int) -> None:
        """Run a grid and add to `counts`. Raises MachineError."""
        pointers = (ctypes.c_void_p * len(arguments))(*map(ctypes.addressof, arguments))
        program = _Blocks(*(ctypes.addressof(array) for array in self._arrays))
        counts, error = _Counts(), ctypes.create_string_buffer(ERROR_BYTES)
        sizes = (self._shared_bytes, RESIDENT_WARPS, L1_LINES, ERROR_BYTES)
        shared, resident, lines, size = map(ctypes.c_size_t, sizes)
        places = ctypes.byref(program), resident, lines, ctypes.byref(counts), error, size
        if not self._model(self._entry, pointers, blocks, block_dim, shared, *places):
            raise MachineError(error.value.decode())
        for field in fields(Counts):
            setattr(self.counts, field.name, getattr(self.counts, field.name) + getattr(counts, field.name))


@functools.cache
def model_kernel(kernel: wp.Kernel, block_dim: int) -> ModelKernel:
    """A kernel as Warp would compile it for a GPU, to be counted."""
    return ModelKernel(ptx_of(kernel, block_dim), f"{kernel.get_mangled_name()}_cuda_kernel_forward")
