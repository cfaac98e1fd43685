"""Builds a kernel's PTX for the host, and launches it in place of Warp."""

import contextlib
import ctypes
import functools
import math
import os
import shlex
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import warp as wp
from warp._src.context import pack_arg
from warp._src.types import launch_bounds_t

from bench.ptx.translation import translate
from wive.warp_kernels.launching import launch as wive_launches

HERE = Path(__file__).parent
COMPILER = shlex.split(os.environ.get("CXX", "c++"))
ARCHITECTURE = 90
# Not optimised: compiling takes longer than running.
FLAGS = ["-std=c++20", "-w", "-fPIC", "-shared", "-ffp-contract=off", "-fno-strict-aliasing", "-fwrapv"]
ERROR_BYTES = 1024


class MachineError(RuntimeError):
    """Threads of a launch did what CUDA does not allow."""


def build(text: str, *flags: str) -> ctypes.CDLL:
    """The shared library of C++ text; those built later may use its functions."""
    with tempfile.TemporaryDirectory(prefix="ptx") as folder:
        source, library = Path(folder) / "program.cpp", Path(folder) / "program.so"
        source.write_text(text)
        command = [*COMPILER, *FLAGS, *flags, f"-I{HERE}", "-o", str(library), str(source)]
        subprocess.run(command, check=True, timeout=300)
        return ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)


@functools.cache
def machine() -> Any:
    """The library that runs grids of blocks, and models them."""
    library = build('#include "machine.cpp"\n#include "model.cpp"', "-O2")
    library.ptx_launch.restype = library.ptx_model.restype = ctypes.c_bool
    return library


@functools.cache
def ptx_of(kernel: wp.Kernel, block_dim: int, architecture: int = ARCHITECTURE) -> str:
    """The PTX of a kernel's module, as NVRTC writes it. Raises if its CUDA code does not compile."""
    kernel.module.options["block_dim"] = block_dim
    with tempfile.TemporaryDirectory(prefix="ptx") as out:
        wp.compile_aot_module(kernel.module, arch=architecture, module_dir=out, use_ptx=True)
        (path,) = Path(out).glob(f"*.sm{architecture}.ptx")
        return path.read_text().rstrip("\0")


class HostKernel:
    """A kernel whose PTX was built for the host."""

    def __init__(self, ptx: str, name: str) -> None:
        """Build the kernel of that name in PTX text."""
        machine()
        program = translate(ptx, name)
        self._entry = ctypes.cast(build(program.text).ptx_entry, ctypes.c_void_p)
        self._shared_bytes = program.shared_bytes

    def run(self, arguments: list[Any], blocks: int, block_dim: int, seed: int) -> None:
        """Run a grid, with ctypes values as arguments; `seed` draws the order of the threads.

        Raises MachineError.
        """
        pointers = (ctypes.c_void_p * len(arguments))(*map(ctypes.addressof, arguments))
        shared, random = ctypes.c_size_t(self._shared_bytes), ctypes.c_uint64(seed)
        error, size = ctypes.create_string_buffer(ERROR_BYTES), ctypes.c_size_t(ERROR_BYTES)
        if not machine().ptx_launch(self._entry, pointers, blocks, block_dim, shared, random, error, size):
            raise MachineError(error.value.decode())


@functools.cache
def host_kernel(kernel: wp.Kernel, block_dim: int) -> HostKernel:
    """A kernel as Warp would compile it for a GPU."""
    return HostKernel(ptx_of(kernel, block_dim), f"{kernel.get_mangled_name()}_cuda_kernel_forward")


@contextlib.contextmanager
def on_the_host(made: Any = host_kernel, seed: int = 1) -> Iterator[None]:
    """A block in which `wp.launch` runs the PTX of kernels on arrays of the CPU device.

    `made(kernel, block_dim)` is the `HostKernel` to run.
    """

    def launch(
        kernel: wp.Kernel,
        dim: Any,
        inputs: Any = (),
        outputs: Any = (),
        *,
        block_dim: int = 256,
        **options: Any,
    ) -> None:
        shape = (dim,) if isinstance(dim, int) else tuple(dim)
        given = zip(kernel.adj.args, [*inputs, *outputs], strict=True)
        arguments = [pack_arg(kernel, taken.type, taken.label, value, "cpu") for taken, value in given]
        blocks = math.ceil(math.prod(shape) / block_dim)
        made(kernel, block_dim).run([launch_bounds_t(shape), *arguments], blocks, block_dim, seed)

    # What is launched is what a CUDA device would get, though arrays are the CPU device's.
    changed = [(wp, "launch", launch), (wive_launches, "loops_in_warps", lambda device, lanes: True)]
    with contextlib.ExitStack() as undo:
        for place, name, value in changed:
            undo.callback(setattr, place, name, getattr(place, name))
            setattr(place, name, value)
        yield
