"""The same NumPy rays through embreex, trimesh, Warp, Open3D and wive from Python, arrays out.

`ratio`: the other's seconds over wive's for the same query on the same rays, in turn; above 1 wive is faster.
trimesh's intersector is measured against `wive.Scene` and against its drop-in replacement in `wive.trimesh`.
With one thread both run on one core and CPU time counts; with all threads wall-clock time counts, and Open3D
takes as many as wive (embreex, trimesh and Warp's CPU device always use one thread). Every library runs with
its defaults, wive watertight. `hits` is the number of hits found; all-hit counts differ if trimesh skips near
hits or finds one twice. The last table has microseconds of a whole call for a single ray, median and 99th
percentile.
"""

import argparse
from collections.abc import Iterator, Sequence

import numpy as np

from bench.contenders.python_callers import ALL, QUERIES, SCENE, Caller, Ours, absent, others, thread_counts
from bench.latency import QUICK_SECONDS, measured
from bench.support import report
from bench.support.groups import grouped
from bench.support.options import listed, scene_parser
from bench.support.rays import Rays, recorded_rays
from bench.support.scenes import Mesh, SceneFolder
from bench.support.timing import (
    QUICK,
    Effort,
    compare,
    geometric_mean,
    one_core,
    timed,
    wall_timed,
)

SCENES = ("living_room", "bmw_m6", "bathroom_salledebain", "furball_embree_tubes")
RAY_KINDS = ("primary", "diffuse", "random")
RAYS, QUICK_RAYS = 131_072, 4_096
# All hits take fewer rays, because trimesh casts every ray again from each of its hits.
ALL_HITS_RAYS, QUICK_ALL_HITS_RAYS = 16_384, 256
EFFORT = Effort(least=5, most=9)
SINGLE_RAYS = 64  # different rays, called in turn
SINGLE_SECONDS = 0.5

COLUMNS = [
    "scene", "triangles", "rays", "query", "ours", "other", "threads", "count", "ratio", "low", "high",
    "wive_mrays", "other_mrays", "wive_hits", "other_hits", "rounds",
]  # fmt: skip
MEAN_COLUMNS = ["query", "ours", "other", "threads", "mean", "lowest", "lowest_at"]
SINGLE_COLUMNS = ["scene", "query", "caller", "p50_us", "p99_us", "calls"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, SCENES)
    rows: list[report.Row] = []
    single: list[report.Row] = []
    missing = [f"{name} is not installed" for name in absent()]
    for name in scenes.names:
        mesh = folder.load(name)
        recorded = recorded_rays(mesh)
        ours = Ours(mesh)
        rivals = list(others(mesh))
        for kind in chosen.rays:
            for row in speed_rows(mesh, ours, rivals, recorded[kind], chosen.quick):
                rows.append(row)
                report.print_progress(row, ("scene", "rays", "other", "threads", "ratio"))
        single += single_rows(mesh, ours, rivals, recorded["random"], chosen.quick)
    means = mean_rows(rows)
    report.print_table(rows, COLUMNS, "NumPy in and out: the other's seconds over wive's")
    report.print_table(means, MEAN_COLUMNS, "Geometric mean and lowest over scenes and rays")
    report.print_table(single, SINGLE_COLUMNS, "One ray: microseconds per call")
    print("".join(f"\n{line}" for line in missing))
    content = {"missing": missing, "rows": rows, "means": means, "single": single}
    whole = scenes.whole and not chosen.quick and chosen.rays == RAY_KINDS and not missing
    report.save("python", content, chosen.out, whole=whole)


def speed_rows(
    mesh: Mesh, ours: Ours, rivals: Sequence[Caller], recorded: Rays, quick: bool
) -> Iterator[report.Row]:
    """One row per rival, number of threads and wive call for the same query."""
    for rival in rivals:
        if rival.query == ALL:
            rays = recorded.thinned(QUICK_ALL_HITS_RAYS if quick else ALL_HITS_RAYS)
        else:
            rays = recorded.thinned(QUICK_RAYS if quick else RAYS)
        for threads in thread_counts() if rival.threads is None else (rival.threads,):
            for mine in ours.counterparts(rival, threads):
                yield {
                    "scene": mesh.name,
                    "triangles": len(mesh.faces),
                    "rays": rays.kind,
                    "query": rival.query,
                    "ours": mine.name,
                    "other": rival.name,
                    "threads": threads,
                    "count": len(rays),
                    **race(mine, rival, rays, threads, quick),
                }


def race(ours: Caller, rival: Caller, rays: Rays, threads: int, quick: bool) -> report.Row:
    """Times both in turn on the same arrays."""
    timer = timed if threads == 1 else wall_timed
    arrays = rays.origins, rays.directions
    found = ours.hits(ours.call(*arrays)), int(rival.hits(rival.call(*arrays)))  # warms up
    runs = timer(lambda: ours.call(*arrays)), timer(lambda: rival.call(*arrays))
    if threads == 1:
        with one_core():
            outcome = compare(*runs, QUICK if quick else EFFORT)
    else:
        outcome = compare(*runs, QUICK if quick else EFFORT)
    return {
        "ratio": outcome.ratio,
        "low": outcome.low,
        "high": outcome.high,
        "wive_mrays": len(rays) / outcome.our_seconds * 1e-6,
        "other_mrays": len(rays) / outcome.their_seconds * 1e-6,
        "wive_hits": found[0],
        "other_hits": found[1],
        "rounds": outcome.rounds,
    }


def single_rows(
    mesh: Mesh, ours: Ours, rivals: Sequence[Caller], recorded: Rays, quick: bool
) -> Iterator[report.Row]:
    """One row per caller, wive's for every query."""
    alone = [rival for rival in rivals if rival.threads in (None, 1)]
    callers = [*(ours.by_scene(query, 1) for query in QUERIES), *alone]
    callers += [caller for rival in alone for caller in ours.counterparts(rival, 1) if caller.name != SCENE]
    parts = [(recorded.origins[i : i + 1], recorded.directions[i : i + 1]) for i in range(SINGLE_RAYS)]
    for caller in callers:
        calls = [lambda part=part, caller=caller: caller.call(*part) for part in parts]
        with one_core():
            seconds = measured(calls, QUICK_SECONDS if quick else SINGLE_SECONDS)
        p50, p99 = (float(q) for q in np.quantile(seconds, (0.5, 0.99)))
        yield {
            "scene": mesh.name,
            "query": caller.query,
            "caller": caller.name,
            "p50_us": p50 * 1e6,
            "p99_us": p99 * 1e6,
            "calls": len(seconds),
        }


def mean_rows(rows: Sequence[report.Row]) -> list[report.Row]:
    """Geometric mean and lowest ratio over scenes and kinds of rays, per rival and number of threads."""
    means = []
    for key, group in grouped(rows, ("query", "ours", "other", "threads")):
        lowest = min(group, key=lambda row: float(row["ratio"]))
        means.append(
            {
                **key,
                "mean": geometric_mean([row["ratio"] for row in group]),
                "lowest": lowest["ratio"],
                "lowest_at": f"{lowest['scene']}, {lowest['rays']}",
            }
        )
    return means


def _label(row: report.Row) -> str:
    return row["other"] if row["ours"] == SCENE else f"{row['other']}, against {row['ours']}"


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("python", __doc__)
    parser.add_argument("--rays", type=listed(RAY_KINDS), default=RAY_KINDS, help=", ".join(RAY_KINDS))
    return parser.parse_args(options)
