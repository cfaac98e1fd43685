"""What the sections of `bench gpu` share: the device, the meshes, the trees, and the time left."""

import re
import time
from collections.abc import Callable
from functools import cache
from typing import Any, Literal

import numpy as np
import warp as wp
from numpy.typing import NDArray

import wive
from bench.contenders.compiled_shim import BenchError
from bench.support.scenes import SceneFolder

SCENES = ("living_room", "terrain_jacksboro", "city_san_francisco", "bathroom_salledebain")
Lanes = Literal[1, 8]
ROUNDS, QUICK_ROUNDS = 7, 2


class Session:
    """One device and the meshes to measure on it."""

    def __init__(
        self,
        device: str,
        folder: SceneFolder,
        names: list[str],
        budget: float,
        quick: bool = False,
        workers: int = 1,
    ) -> None:
        """Starts the clock of the budget. On the CPU device and with `quick` there are few rays."""
        self.began, self.budget = time.perf_counter(), budget
        try:
            self.device = str(wp.get_device(device).alias)
        except (RuntimeError, ValueError) as problem:
            raise BenchError(f"no Warp device {device!r}: {problem}") from None
        self.names, self.quick, self.workers = names, quick, workers
        self.on_gpu = bool(wp.get_device(device).is_cuda)
        self.mesh = cache(folder.load)
        self.core, self.scene = cache(self._core), cache(self._scene)

    @property
    def short_name(self) -> str:
        """The device's name for a file: "h200" for "NVIDIA H200"."""
        name = wp.get_device(self.device).name if self.on_gpu else "cpu"
        return re.sub(r"[^a-z0-9]+", "-", name.lower().removeprefix("nvidia ")).strip("-")

    def seconds_left(self) -> float:
        """Seconds of the budget."""
        return self.budget - (time.perf_counter() - self.began)

    def count(self, on_gpu: int, on_cpu: int) -> int:
        """How many rays to trace, by device."""
        return on_gpu if self.on_gpu and not self.quick else on_cpu

    def vertices(self, name: str, precision: str = "float32") -> NDArray[Any]:
        """The mesh's vertices in that precision."""
        return self.mesh(name).vertices.astype(precision, copy=False)

    def _core(
        self, name: str, precision: str = "float32", accuracy: Any = "watertight", nodes: Any = "float32"
    ) -> wive.Scene:
        vertices, faces = self.vertices(name, precision), self.mesh(name).faces
        return wive.Scene(vertices, faces, accuracy=accuracy, nodes=nodes)

    def _scene(
        self, name: str, precision: str = "float32", accuracy: Any = "watertight", nodes: Any = "float32"
    ) -> wive.Scene:
        vertices, faces = self.vertices(name, precision), self.mesh(name).faces
        return wive.Scene(vertices, faces, device=self.device, accuracy=accuracy, nodes=nodes)

    def upload(self, values: NDArray[Any]) -> Any:
        """An array on the device; rows of three become vectors."""
        vectors = {"float32": wp.vec3, "float64": wp.vec3d}
        dtype = {"dtype": vectors[values.dtype.name]} if values.ndim == 2 else {}
        return wp.array(np.ascontiguousarray(values), device=self.device, **dtype)

    def limits(self) -> tuple[Any, Any]:
        """tmin 0 and tmax infinity for all rays."""
        return self.upload(np.zeros(1, np.float32)), self.upload(np.full(1, np.inf, np.float32))

    def outputs(self, count: int) -> tuple[Any, Any, Any]:
        """New arrays for t, prim and uv."""
        dtypes = wp.float32, wp.int32, wp.vec2
        t, prim, uv = (wp.empty(count, dtype=dtype, device=self.device) for dtype in dtypes)
        return t, prim, uv

    def synchronize(self) -> None:
        """Waits for the device."""
        wp.synchronize_device(self.device)

    def device_seconds(self, work: Callable[[], object]) -> float:
        """Median seconds of the work on the device alone, by CUDA events; on the CPU by the clock."""
        return median_seconds(self._run_between_events(work) if self.on_gpu else _clocked(work), self.rounds)

    def call_seconds(self, work: Callable[[], object], rounds: int) -> float:
        """Median seconds of the work seen from Python, the wait for the device included."""

        def run() -> None:
            work()
            self.synchronize()

        return median_seconds(_clocked(run), rounds)

    @property
    def rounds(self) -> int:
        """How often work is timed."""
        return QUICK_ROUNDS if self.quick else ROUNDS

    def _run_between_events(self, work: Callable[[], object]) -> Callable[[], float]:
        def run() -> float:
            begin, end = (wp.Event(self.device, enable_timing=True) for _ in range(2))
            wp.record_event(begin)
            work()
            wp.record_event(end)
            return float(wp.get_event_elapsed_time(begin, end)) / 1000  # from milliseconds

        return run


def _clocked(work: Callable[[], object]) -> Callable[[], float]:
    def run() -> float:
        start = time.perf_counter()
        work()
        return time.perf_counter() - start

    return run


def median_seconds(run: Callable[[], float], rounds: int) -> float:
    """The median of what `run` returns, after one run to warm up."""
    run()
    return float(np.median([run() for _ in range(rounds)]))


def differing(ours: Any, right: Any) -> int:
    """How many numbers differ, NaN aside, which equals NaN."""
    mine, truth = np.asarray(ours), np.asarray(right)
    if mine.shape != truth.shape:
        return max(mine.size, truth.size)
    both_nan = (mine != mine) & (truth != truth)
    return int(np.count_nonzero((mine != truth) & ~both_nan))
