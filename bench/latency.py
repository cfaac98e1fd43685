"""Latency per call against throughput over batch sizes: every backend, Warp's own query and embreex.

`curve`: closest hits of 1, 4, 16, ... rays per call, from arrays on the contender's device; a call ends when
its hits are written. p50 and p99 are quantiles of the calls' wall-clock seconds, Python's overhead included;
with few calls p99 is the longest. CPU backends use --threads threads, by default 1 like Warp's CPU device and
embreex; all then run on one core. `compare`: seconds of wp.mesh_query_ray, with its trees by SAH and by
cuBQL, over those of wive's Warp kernels on the same rays, launched in turn on arrays made before: above 1
wive is faster.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext

import numpy as np

from bench.contenders.compiled_shim import BenchError
from bench.contenders.latency_contenders import Call, Contender, LaneForm, contenders
from bench.support import report
from bench.support.options import listed, scene_parser
from bench.support.rays import KINDS, Rays, recorded_rays
from bench.support.scenes import SceneFolder
from bench.support.timing import QUICK, Effort, one_core

PARTS = ("curve", "compare")
CURVE_SCENE = 0  # the first of the scenes, by default the smallest
COMPARED_KINDS = ("primary", "diffuse", "random")
LARGEST_BATCH = 4**11
QUICK_BATCH = 4**6
RAYS = 65_536  # compared, per kind and scene
QUICK_RAYS = 16_384
# Calls per batch size: as many as the seconds allow, within these bounds.
FEWEST_CALLS, MOST_CALLS = 3, 2000
SECONDS, QUICK_SECONDS = 1.0, 0.02
LONGEST_CALL = 4.0  # seconds: batches that would take longer are left out
# Calls take this many batches of different rays in turn, so that caches don't hold all nodes of one batch.
VARIANTS = 16

CURVE_COLUMNS = ["scene", "rays", "contender", "device", "batch", "p50_us", "p99_us", "mrays", "calls"]
COMPARE_COLUMNS = [
    "scene", "triangles", "rays", "accuracy", "lanes", "builder", "device", "count", "ratio", "low", "high",
    "wive_mrays", "mesh_query_ray_mrays", "rounds", "mismatches",
]  # fmt: skip
MEAN_COLUMNS = ["rays", "accuracy", "lanes", "builder", "mean", "lowest"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes)
    device, description = warp_device(chosen.device)
    lanes: tuple[LaneForm, ...] = chosen.lanes or ((1, 8) if device.startswith("cuda") else (8,))
    curve: list[report.Row] = []
    comparison: list[report.Row] = []
    means: list[report.Row] = []
    if "curve" in chosen.parts:
        mesh = folder.load(scenes.names[CURVE_SCENE])
        rays = recorded_rays(mesh)[chosen.rays]
        with one_core() if chosen.threads == 1 else nullcontext():
            for contender in contenders(mesh, device, lanes, chosen.threads, chosen.contenders):
                for row in curve_rows(contender, rays, chosen.quick):
                    curve.append({"scene": mesh.name, "rays": rays.kind, **row})
                    report.print_progress(row, ("contender", "batch", "p50_us", "mrays"))
    if "compare" in chosen.parts and device:
        from bench.contenders.warp_race import compare_rows, mean_rows

        effort = QUICK if chosen.quick else Effort()
        for name in scenes.names:
            mesh = folder.load(name)
            recorded = recorded_rays(mesh)
            most = QUICK_RAYS if chosen.quick else RAYS
            sets = [recorded[kind].thinned(most) for kind in COMPARED_KINDS]
            for row in compare_rows(mesh, device, lanes, sets, effort):
                comparison.append(row)
                report.print_progress(row, ("scene", "rays", "accuracy", "lanes", "builder", "ratio"))
        means = mean_rows(comparison)
    report.print_table(curve, CURVE_COLUMNS, "Latency per call in microseconds, and Mray/s at the median")
    report.print_table(comparison, COMPARE_COLUMNS, "wp.mesh_query_ray's seconds over wive's on Warp")
    report.print_table(means, MEAN_COLUMNS, "Geometric means over scenes, and the lowest")
    content = {
        "warp": description,
        "threads": chosen.threads,
        "curve": curve,
        "compare": comparison,
        "means": means,
    }
    suffix = f"-{description['name'].replace(' ', '-')}" if device.startswith("cuda") else ""
    whole = scenes.whole and bool(device) and is_whole(chosen)
    report.save(f"latency{suffix}", content, chosen.out, whole=whole)


def curve_rows(contender: Contender, rays: Rays, quick: bool) -> Iterator[report.Row]:
    """One row per batch size, up to the longest call."""
    batch, longest = 1, 0.0
    while batch <= (QUICK_BATCH if quick else LARGEST_BATCH) and 4 * longest < LONGEST_CALL:
        calls = [contender.prepare(*part) for part in _batches(rays, batch)]
        seconds = measured(calls, QUICK_SECONDS if quick else SECONDS)
        p50, p99 = (float(q) for q in np.quantile(seconds, (0.5, 0.99)))
        longest = p50
        yield {
            "contender": contender.name,
            "device": contender.device,
            "batch": batch,
            "p50_us": p50 * 1e6,
            "p99_us": p99 * 1e6,
            "mrays": batch / p50 / 1e6,
            "calls": len(seconds),
        }
        batch *= 4


def measured(calls: Sequence[Call], budget: float) -> list[float]:
    """Seconds of each call, made in turn after two to warm up."""
    for call in calls[:2]:
        call()
    seconds: list[float] = []
    begin = time.perf_counter()
    while len(seconds) < MOST_CALLS:
        start = time.perf_counter()
        if len(seconds) >= FEWEST_CALLS and start - begin > budget:
            break
        calls[len(seconds) % len(calls)]()
        seconds.append(time.perf_counter() - start)
    return seconds


def warp_device(name: str | None) -> tuple[str, report.Row]:
    """The Warp device to measure and its description; "" if Warp can't be used."""
    import wive
    from wive._internal.devices import resolve_device

    backend = wive.backends()["warp"]
    if not backend.usable:
        if name is not None:
            raise BenchError(f"no device {name!r}: {backend.reason}")
        return "", {}
    try:
        alias = resolve_device(name)
    except ValueError as error:
        raise BenchError(str(error)) from error
    import warp as wp

    device = wp.get_device(alias)
    described = {"version": wp.config.version, "device": alias, "name": device.name}
    if device.is_cuda:
        described |= {
            "arch": device.arch,
            "memory": device.total_memory,
            "driver": wp.get_cuda_driver_version(),
        }
    return alias, described


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("latency", __doc__)
    parser.add_argument("--device", help="Warp device; default: the first CUDA device, else cpu")
    parser.add_argument(
        "--lanes", type=lane_forms, help="lane forms on Warp, e.g. 1,8; default: both on CUDA, 8 on cpu"
    )
    parser.add_argument("--threads", type=int, default=1, help="threads of CPU backends")
    parser.add_argument("--contenders", type=listed(), default=(), help="names of the curve; all by default")
    parser.add_argument("--rays", choices=KINDS, default="random", help="rays of the curve")
    parser.add_argument("--parts", type=listed(PARTS), default=PARTS, help=", ".join(PARTS))
    return parser.parse_args(options)


def lane_forms(text: str) -> tuple[LaneForm, ...]:
    """Lane forms with commas between them."""
    forms: dict[str, LaneForm] = {"1": 1, "8": 8}
    names = [name.strip() for name in text.split(",")]
    if not set(names) <= forms.keys():
        raise argparse.ArgumentTypeError(f"expected 1, 8 or both, got {text!r}")
    return tuple(forms[name] for name in names)


def is_whole(chosen: argparse.Namespace) -> bool:
    """Whether these options measure everything that the docs quote, scenes aside."""
    return not chosen.quick and not chosen.contenders and set(chosen.parts) == set(PARTS)


def _batches(rays: Rays, size: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Up to VARIANTS batches of different rays; a batch larger than the set repeats rays."""
    variants = max(1, min(VARIANTS, len(rays) // size))
    for variant in range(variants):
        chosen = np.arange(variant * size, (variant + 1) * size) % len(rays)
        yield rays.origins[chosen], rays.directions[chosen]
