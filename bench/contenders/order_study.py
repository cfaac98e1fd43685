"""Child orders and kernels that only `python -m bench order` compares, compiled from bench/native/study.

The product has one child order and kernels that follow it. Here the order rows of its trees are written anew,
and the same kernels follow them; kernels that sort children by distance are compiled beside them.
"""

import ctypes
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import compiled, compiler_version
from wive import _cpu

Order = Literal["treelet", "diagonal", "slots", "none"]
STORED_ORDERS: tuple[Order, ...] = ("treelet", "diagonal", "slots", "none")
# Kernels that sort, with those of the product that do the same without sorting.
SORTING = {"avx512.distance": "avx512.full", "scalar.distance": "scalar"}
ACCURACIES = ("fast", "watertight")

CPU = Path(__file__).parents[2] / "cpu"
STUDY = Path(__file__).parents[1] / "native" / "study"
# The flags of these kernels in CMakeLists.txt.
FLAGS = ["-std=c++20", "-shared", "-fPIC", "-DNDEBUG", "-ffp-contract=off", "-fno-math-errno", "-pthread"]
AVX512 = ["-mavx2", "-mfma", "-mbmi", "-mbmi2", "-mlzcnt", "-mpopcnt"]
AVX512 += ["-mavx512f", "-mavx512vl", "-mavx512dq", "-mavx512bw"]


def tree(
    vertices: NDArray[np.float32],
    faces: NDArray[np.int32],
    accuracy: Literal["fast", "watertight"],
    order: Order,
) -> _cpu.Bvh:
    """A float32 tree whose nodes have this child order."""
    bvh = _cpu.Bvh(vertices, faces, accuracy)
    if order != "treelet":
        nodes = bvh.nodes  # read-only, but nothing else refers to this tree yet
        number = STORED_ORDERS.index(order) - 1
        _orders().study_write_order(
            ctypes.c_void_p(nodes.ctypes.data), ctypes.c_size_t(len(nodes)), ctypes.c_int(number)
        )
    return bvh


def intersect(
    kernel: str, bvh: _cpu.Bvh, *rays: NDArray[np.float32], in_flight: int = 0, stats: bool = False
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float32], NDArray[np.int32] | None]:
    """Closest hits by a sorting kernel: t, prim, uv and steps, as Bvh.intersect on one thread gives them.

    rays: origins, directions, tmin and tmax, the last two with one value each.
    """
    count = len(rays[0])
    t, prim = np.empty(count, np.float32), np.empty(count, np.int32)
    uv = np.empty((count, 2), np.float32)
    steps = np.empty((count, 3), np.int32) if stats else None
    arrays = [np.ascontiguousarray(array, np.float32) for array in rays]
    inputs = [bvh.units, bvh.center, bvh.extent]
    trace = getattr(_kernels(kernel), f"study_trace_{kernel.removesuffix('.distance')}")
    trace(
        *(_address(array) for array in inputs),
        ctypes.c_int(ACCURACIES.index(bvh.accuracy)),
        *(_address(array) for array in arrays),
        ctypes.c_size_t(count),
        *(_address(array) for array in (t, prim, uv, steps)),
        ctypes.c_uint(in_flight),
    )
    return t, prim, uv, steps


def _address(array: NDArray[np.generic] | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


@cache
def _orders() -> ctypes.CDLL:
    sources = [STUDY / "orders.cpp", CPU / "build" / "order.cpp"]
    return ctypes.CDLL(str(compiled(*sources, flags=[*FLAGS, "-O3", f"-I{CPU}"], headers=[CPU])))


@cache
def _kernels(kernel: str) -> ctypes.CDLL:
    isa = kernel.removesuffix(".distance")
    gcc = "clang" not in compiler_version()
    flags = [*FLAGS, f"-I{CPU}", f"-I{STUDY}", f"-DWIVE_ISA={isa}", f'-DWIVE_DISTANCE="{isa}_distance.h"']
    if isa == "avx512":
        flags += ["-O3", *AVX512, *(["-fira-region=one"] if gcc else [])]
    else:
        flags += ["-O2", "-fpeel-loops"] if gcc else ["-O3"]
    sources = [STUDY / "kernels_distance.cpp", CPU / "kernels" / "trace.cpp"]
    sources += [CPU / "core" / f"{name}.cpp" for name in ("control_groups", "memory", "poll", "thread_count")]
    sources.append(CPU / "traverse" / "scaled_limits.cpp")
    return ctypes.CDLL(str(compiled(*sources, flags=flags, headers=[CPU, STUDY])))
