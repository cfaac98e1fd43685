"""The CUDA side without a GPU: every kernel is built ahead of time, and held to what the assembler says.

Warp brings NVRTC, which compiles to PTX. Registers, stack and spills come from ptxas, which has to be as new
as that NVRTC: `pip install nvidia-cuda-nvcc`, a CUDA toolkit, or WIVE_PTXAS=/path/to/ptxas. Instructions come
from nvdisasm: `pip install nvidia-cuda-nvdisasm`, or WIVE_NVDISASM=/path/to/nvdisasm.
"""

import importlib.util
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

wp = pytest.importorskip("warp")

from bench.ptx.launching import ptx_of
from wive.warp_kernels.launching import sorting
from wive.warp_kernels.launching.kernels import make_kernel
from wive.warp_kernels.launching.launch import MOST_CUDA_THREADS, default_block_dim

STACK = 96
BLOCK = 256  # Warp's own
BLOCK_REGISTERS = 64 * 1024  # on every CUDA device
QUERIES = ("closest", "any", "count", "all")

# Every query on one architecture, and on the others those two that hold nearly all there is to compile, in
# the accuracy that has more of it; exact trees, which take longest, on one architecture. Of compressed nodes
# and of float64, every query in one accuracy and the closest hit in each. The longest run with --slow.


def slow(*values: object) -> Any:
    """The parameters of a build that takes long."""
    return pytest.param(*values, marks=pytest.mark.slow)


BUILDS = [
    *[(query, 90, accuracy) for query in QUERIES for accuracy in ("fast", "watertight")],
    *[(query, architecture, "watertight") for query in ("closest", "any") for architecture in (80, 100)],
    ("count", 90, "exact"),
    slow("closest", 90, "exact"),
]
COMPRESSED_BUILDS = [
    *[(query, "watertight") for query in QUERIES],
    ("closest", "fast"),
    slow("closest", "exact"),
    slow("count", "exact"),
]
DOUBLE_BUILDS = [
    *[(query, 90, "watertight", "float32") for query in QUERIES],
    ("closest", 90, "fast", "float32"),
    ("closest", 90, "watertight", "compressed"),
    *[slow("closest", architecture, "watertight", "float32") for architecture in (80, 100)],
]

# Registers, measured with NVRTC and ptxas 13.5 and rounded up to a multiple of eight.
REGISTERS = {
    ("fast", 8): 80,
    ("watertight", 8): 88,
    ("fast", 1): 64,
    ("watertight", 1): 72,
    ("exact", 8): 128,
    ("exact", 1): 128,
}
CLOSEST_REGISTERS = 80  # of the closest hit, watertight, L = 8
# Compressed nodes need a few more, for unpacking.
COMPRESSED_REGISTERS = {
    ("fast", 8): 80,
    ("watertight", 8): 88,
    ("fast", 1): 64,
    ("watertight", 1): 72,
    ("exact", 8): 128,
    ("exact", 1): 128,
}
# In float64 scenes, in either node form.
DOUBLE_REGISTERS = {
    ("fast", 8): 152,
    ("watertight", 8): 144,
    ("fast", 1): 120,
    ("watertight", 1): 112,
}
# Bytes: a thread that owns its stack holds a child and, for the closest hit, a distance per entry, and up to
# 28 words of the ray behind them, whose parts begin at even words, and u and v of the closest hit. A group's
# stack is in shared memory.
STACK_BYTES = {
    "closest": STACK * 8 + 120,
    "any": STACK * 4 + 112,
    "count": STACK * 4 + 112,
    "all": STACK * 4 + 112,
}
DOUBLE_STACK_BYTES = 72  # more: rays are kept in double
EXACT_STACK_BYTES = 9 * 1024  # integers of the exact test, of two triangles if hits are compared


def stack_limit(query: str, accuracy: str, lanes: int) -> int:
    """The most local memory that a thread may take, in bytes."""
    own = EXACT_STACK_BYTES if accuracy == "exact" else 0
    return own + (STACK_BYTES[query] if lanes == 8 else 0)


@dataclass(frozen=True)
class Usage:
    """What a kernel's threads take."""

    registers: int
    stack: int
    spills: int


def find_tool(name: str) -> Iterator[Path]:
    """Every program of CUDA's of that name there is to try, in the order of preference."""
    if asked := os.environ.get(f"WIVE_{name.upper()}"):
        yield Path(asked)
    spec = importlib.util.find_spec("nvidia")
    for folder in (spec.submodule_search_locations if spec is not None else None) or []:
        yield from sorted(Path(folder).glob(f"*/bin/{name}"), reverse=True)
    if on_path := shutil.which(name):
        yield Path(on_path)
    yield from sorted(Path("/usr/local").glob(f"cuda*/bin/{name}"), reverse=True)


def assemble(ptx: str, architecture: int, folder: Path) -> Usage:
    """Assemble PTX and read what ptxas says of its kernel; skips if no ptxas here knows its version."""
    source = folder / "kernel.ptx"
    source.write_text(ptx)
    tried = []
    for ptxas in find_tool("ptxas"):
        command = [
            str(ptxas),
            "-v",
            f"--gpu-name=sm_{architecture}",
            str(source),
            "-o",
            str(folder / "kernel.cubin"),
        ]
        run = subprocess.run(command, capture_output=True, text=True, timeout=120)
        if "Unsupported .version" in run.stderr:
            tried.append(str(ptxas))
            continue
        assert run.returncode == 0, run.stderr
        frames = re.findall(
            r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads", run.stderr
        )
        registers = re.findall(r"Used (\d+) registers", run.stderr)
        assert frames and registers, run.stderr
        return Usage(
            registers=max(map(int, registers)),
            stack=max(int(frame[0]) for frame in frames),
            spills=sum(int(frame[1]) + int(frame[2]) for frame in frames),
        )
    pytest.skip(
        f"no ptxas reads this PTX (tried: {', '.join(tried) or 'none found'}): pip install nvidia-cuda-nvcc"
    )


@pytest.mark.timeout(120)
@pytest.mark.parametrize("lanes", [8, 1])
@pytest.mark.parametrize(("query", "architecture", "accuracy"), BUILDS)
def test_kernel_compiles_for_cuda_within_its_limits(
    query: str, architecture: int, accuracy: str, lanes: int, tmp_path: Path
) -> None:
    kernel = make_kernel(query, accuracy, lanes, STACK)
    ptx = ptx_of(kernel, default_block_dim(lanes), architecture)
    # The CUDA branches are what was compiled: the collectives of a group, wide loads of a thread.
    assert "vote.sync.ballot" in ptx
    assert ("shfl.sync" in ptx) == (lanes == 1 and query in ("closest", "count"))
    assert ("ld.global.nc.v4" in ptx) == (lanes == 8)
    usage = assemble(ptx, architecture, tmp_path)
    assert usage.spills == 0
    assert usage.stack <= stack_limit(query, accuracy, lanes)
    assert usage.registers <= REGISTERS[accuracy, lanes]
    if (query, accuracy, lanes) == ("closest", "watertight", 8):
        assert usage.registers <= CLOSEST_REGISTERS
    assert REGISTERS[accuracy, lanes] * MOST_CUDA_THREADS["float32"] <= BLOCK_REGISTERS


@pytest.mark.timeout(120)
@pytest.mark.parametrize("query", QUERIES)
def test_threads_of_a_ray_talk_by_instructions_of_whole_warps(query: str, tmp_path: Path) -> None:
    """A collective of some threads of a warp becomes a search for them, which takes five times as long."""
    ptx = ptx_of(make_kernel(query, "watertight", 1, STACK), default_block_dim(1))
    assert "redux" not in ptx and "match" not in ptx
    assert set(re.findall(r"bar\.warp\.sync\s+([^;]+);", ptx)) == {"-1"}
    assemble(ptx, 90, tmp_path)
    nvdisasm = next(find_tool("nvdisasm"), None)
    if nvdisasm is None:
        pytest.skip("no nvdisasm: pip install nvidia-cuda-nvdisasm")
    command = [str(nvdisasm), str(tmp_path / "kernel.cubin")]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    opcodes = re.findall(r"/\*[0-9a-f]+\*/\s+(?:@!?U?P\w+\s+)?([A-Z][A-Z0-9]*)", run.stdout)
    assert "VOTE" in opcodes and "LDG" in opcodes
    assert not {"MATCH", "REDUX"} & set(opcodes)


@pytest.mark.timeout(120)
@pytest.mark.parametrize("lanes", [8, 1])
@pytest.mark.parametrize(("query", "accuracy"), COMPRESSED_BUILDS)
def test_kernel_for_compressed_nodes_compiles_within_its_limits(
    query: str, accuracy: str, lanes: int, tmp_path: Path
) -> None:
    kernel = make_kernel(query, accuracy, lanes, STACK, nodes="compressed")
    usage = assemble(ptx_of(kernel, default_block_dim(lanes)), 90, tmp_path)
    assert usage.spills == 0
    assert usage.stack <= stack_limit(query, accuracy, lanes)
    assert usage.registers <= COMPRESSED_REGISTERS[accuracy, lanes]
    assert COMPRESSED_REGISTERS[accuracy, lanes] * MOST_CUDA_THREADS["float32"] <= BLOCK_REGISTERS


@pytest.mark.timeout(120)
@pytest.mark.parametrize("lanes", [8, 1])
@pytest.mark.parametrize(("query", "architecture", "accuracy", "nodes"), DOUBLE_BUILDS)
def test_kernel_for_float64_scenes_compiles_within_its_limits(
    query: str, architecture: int, accuracy: str, nodes: str, lanes: int, tmp_path: Path
) -> None:
    kernel = make_kernel(query, accuracy, lanes, STACK, nodes=nodes, precision="float64")
    ptx = ptx_of(kernel, default_block_dim(lanes), architecture)
    assert ("ld.global.nc.v2.f64" in ptx) == (lanes == 8)
    usage = assemble(ptx, architecture, tmp_path)
    assert usage.spills == 0
    assert usage.stack <= stack_limit(query, accuracy, lanes) + (DOUBLE_STACK_BYTES if lanes == 8 else 0)
    assert usage.registers <= DOUBLE_REGISTERS[accuracy, lanes]
    assert DOUBLE_REGISTERS[accuracy, lanes] * MOST_CUDA_THREADS["float64"] <= BLOCK_REGISTERS


@pytest.mark.timeout(120)
@pytest.mark.parametrize("lanes", [8, 1])
def test_kernel_with_counters_compiles_for_cuda(lanes: int) -> None:
    for query in ("closest", "any" if lanes == 8 else "count"):
        ptx_of(make_kernel(query, "watertight", lanes, STACK, True), default_block_dim(lanes))


@pytest.mark.timeout(120)
@pytest.mark.parametrize(
    "kernel", [sorting.sort_kernel("float32"), sorting.sort_kernel("float64"), sorting.shift_counts]
)
def test_kernel_that_orders_hits_keeps_them_in_registers(kernel: wp.Kernel, tmp_path: Path) -> None:
    usage = assemble(ptx_of(kernel, BLOCK), 90, tmp_path)
    assert usage.spills == usage.stack == 0
    assert usage.registers <= 64


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __reduce_or_sink(0xffu, x);
#else
    return x;
#endif
""")
def broken_on_cuda(x: wp.uint32) -> wp.uint32: ...


@wp.kernel(module="unique", enable_backward=False)
def planted_fault(x: wp.array(dtype=wp.uint32)):
    x[0] = broken_on_cuda(x[0])


@wp.kernel(module="unique", enable_backward=False)
def planted_spill(x: wp.array(dtype=wp.float32)):
    kept = wp.vector(dtype=wp.float32, length=96)
    for i in range(96):
        kept[i] = x[i]
    at = int(x[0])
    x[0] = kept[at]


@pytest.mark.timeout(60)
def test_guard_fails_on_a_broken_cuda_branch(capfd: pytest.CaptureFixture[str]) -> None:
    array = wp.ones(1, dtype=wp.uint32, device="cpu")
    wp.launch(planted_fault, 1, inputs=[array], device="cpu")  # the CPU branch has nothing wrong with it
    with pytest.raises(Exception, match=r"CUDA|NVRTC|build"):
        ptx_of(planted_fault, BLOCK)


@pytest.mark.timeout(60)
def test_guard_sees_memory_that_a_kernel_falls_back_to(tmp_path: Path) -> None:
    usage = assemble(ptx_of(planted_spill, BLOCK), 90, tmp_path)
    assert usage.stack >= 96 * 4
