"""Speed and latency over the rays in flight on one thread, from scenes in cache to ten million triangles.

With K rays in flight each ray does the plain single-ray traversal, one step in turn. `speedup`: seconds
with one ray in flight over seconds with K, measured in turn on one pinned core. `ray_ns` is the time per
ray; `latency_ns`, K times as long, is the time from a ray's first step to its last, by Little's law.
`limit_mrays` is the speed if every step (inner node or leaf) took one DRAM latency and nothing else took
time: K / (steps per ray x latency), with the latency from a pointer chase over an array larger than every
cache. A speed above the limit is due to caches.
"""

import argparse
import ctypes
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from bench.contenders.compiled_shim import BenchError, compiled
from bench.support import report
from bench.support.options import ACCURACIES, listed, numbers, scene_parser
from bench.support.rays import KINDS, Rays, recorded_rays
from bench.support.scenes import LARGEST, Mesh, SceneFolder
from bench.support.timing import Effort, compare_in_turn, one_core, timed
from wive import _cpu

IN_FLIGHT = (1, 2, 4, 8, 12, 16, 24, 32, 48, 64)
RAY_KINDS = ("diffuse", "random")
# The first one's tree fits the second-level cache.
USUAL = ("terrain_5k", "living_room", "terrain_jacksboro", "bmw_m6", "furball_embree_tubes", LARGEST)
RAYS, QUICK_RAYS = 131_072, 4_096
EFFORT, QUICK_EFFORT = Effort(least=7, most=11), Effort(least=2, most=2)
CHASED_BYTES, CHASED_LOADS = 1 << 29, 4_000_000
QUICK_BYTES, QUICK_LOADS = 1 << 26, 200_000

COLUMNS = [
    "scene", "triangles", "tree_mib", "rays", "in_flight", "speedup", "low", "high", "mrays", "ray_ns",
    "latency_ns", "limit_mrays", "steps", "rounds",
]  # fmt: skip
BEST_COLUMNS = ["scene", "triangles", "tree_mib", "rays", "best", "speedup", "tuned", "mrays", "latency_ns"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, USUAL)
    latency = memory_latency(*((QUICK_BYTES, QUICK_LOADS) if chosen.quick else (CHASED_BYTES, CHASED_LOADS)))
    print(f"a load from memory takes {latency * 1e9:.0f} ns", flush=True)
    rows: list[report.Row] = []
    for name in scenes.names:
        mesh = folder.load(name)
        recorded = recorded_rays(mesh)
        sets = [recorded[kind].thinned(QUICK_RAYS if chosen.quick else RAYS) for kind in chosen.rays]
        tree = _cpu.Bvh(mesh.vertices, mesh.faces, chosen.accuracy)
        for rays in sets:
            for row in ray_rows(mesh, tree, chosen.kernel or best_kernel(), rays, chosen, latency):
                rows.append(row)
                report.print_progress(row, ("scene", "rays", "in_flight", "speedup", "mrays", "limit_mrays"))
    best = best_rows(rows)
    report.print_table(rows, COLUMNS, "Rays in flight: speed over that of one ray at a time")
    report.print_table(best, BEST_COLUMNS, "The best number of rays in flight; tuned: speedup of the default")
    whole = scenes.whole and not (chosen.quick or chosen.kernel) and chosen.in_flight == IN_FLIGHT
    content = {
        "memory_latency_ns": latency * 1e9,
        "kernel": chosen.kernel or best_kernel(),
        "accuracy": chosen.accuracy,
        "rows": rows,
        "best": best,
    }
    report.save("inflight", content, chosen.out, whole=whole and chosen.rays == RAY_KINDS)


def best_kernel() -> str:
    """The first kernel that runs here."""
    return next(name for name, reason in _cpu.kernels().items() if not reason)


def memory_latency(size: int, loads: int) -> float:
    """Seconds of a dependent load from an array of `size` bytes."""
    library = ctypes.CDLL(str(compiled(Path(__file__).parent / "native" / "memory_latency.cpp")))
    library.memory_latency.restype = ctypes.c_double
    library.memory_latency.argtypes = [ctypes.c_size_t, ctypes.c_size_t]
    with one_core():
        seconds = float(library.memory_latency(size, loads))
    if seconds < 0:
        raise BenchError(f"there are no {size >> 20} MiB of memory to measure the latency on")
    return seconds


def ray_rows(
    mesh: Mesh, tree: _cpu.Bvh, kernel: str, rays: Rays, chosen: argparse.Namespace, latency: float
) -> Iterator[report.Row]:
    """One row per number of rays in flight, and one for the number that the core chooses."""

    def trace(in_flight: int) -> None:
        if rays.any_hit:
            tree.occluded(kernel, *rays.arrays, threads=1, in_flight=in_flight)
        else:
            tree.intersect(kernel, *rays.arrays, threads=1, in_flight=in_flight)

    counted = tree.occluded if rays.any_hit else tree.intersect
    stats = counted(kernel, *rays.arrays, stats=True)[-1]
    assert stats is not None
    steps = float(stats[:, :2].sum(axis=1).mean(dtype=np.float64))
    flights = (1, *(k for k in chosen.in_flight if k != 1), 0)  # 0: the core chooses
    runs = [timed(lambda k=k: trace(k)) for k in flights]  # type: ignore[misc]
    with one_core():
        for run in runs:
            run()
        outcomes = compare_in_turn(runs, QUICK_EFFORT if chosen.quick else EFFORT)
    for in_flight, outcome in zip(flights, outcomes, strict=True):
        seconds = outcome.our_seconds / len(rays)
        yield {
            "scene": mesh.name,
            "triangles": len(mesh.faces),
            "tree_mib": tree.memory / 2**20,
            "rays": rays.kind,
            "count": len(rays),
            "in_flight": in_flight or "tuned",
            "speedup": outcome.ratio,
            "low": outcome.low,
            "high": outcome.high,
            "mrays": 1e-6 / seconds,
            "ray_ns": seconds * 1e9,
            "latency_ns": in_flight * seconds * 1e9 or None,
            "limit_mrays": in_flight / (steps * latency) * 1e-6 or None,
            "steps": steps,
            "rounds": outcome.rounds,
        }


def best_rows(rows: Sequence[report.Row]) -> list[report.Row]:
    """The fastest number in flight per scene and kind of rays, and the speedup of the core's choice."""
    best = []
    for key in dict.fromkeys((row["scene"], row["rays"]) for row in rows):
        group = [row for row in rows if (row["scene"], row["rays"]) == key]
        winner = max(
            (row for row in group if row["in_flight"] != "tuned"), key=lambda row: float(row["speedup"])
        )
        tuned = next(row for row in group if row["in_flight"] == "tuned")
        best.append({**winner, "best": winner["in_flight"], "tuned": tuned["speedup"]})
    return best


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("inflight", __doc__)
    parser.add_argument("--in-flight", type=numbers, default=IN_FLIGHT, help="numbers of rays, e.g. 1,8,24")
    parser.add_argument("--rays", type=listed(KINDS), default=RAY_KINDS, help=", ".join(KINDS))
    parser.add_argument("--kernel", help="one of wive's kernels; default: the best here")
    parser.add_argument("--accuracy", choices=ACCURACIES, default="watertight", help="accuracy of the tree")
    return parser.parse_args(options)
