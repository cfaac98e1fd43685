"""wive against native Embree 4 on the very same arrays: speed, build time, SAH cost, memory.

wive with one thread and a given number of rays in flight (1: plain single-ray traversal; tuned: what a batch
gets), against a loop over rtcIntersect1 or rtcOccluded1; float32 and compressed nodes; fast against
Embree's default, watertight against its robust flag; each kernel against Embree held to the same
instruction set. A ratio above 1 means that wive is faster. `mismatches` counts rays that only one side
hits. The part `packets` races what a batch gets on primary rays against rtcIntersect1, 8 and 16.
"""

import argparse
import sys
from collections.abc import Sequence
from itertools import product

from bench.contenders.build_race import build_rows, tree_row
from bench.contenders.compiled_shim import BenchError
from bench.contenders.embree_race import TUNED, Contender, packet_rows, speed_rows
from bench.support import report
from bench.support.groups import grouped
from bench.support.options import ACCURACIES, NODES, in_flights, listed, scene_parser
from bench.support.rays import KINDS, recorded_rays
from bench.support.scenes import LARGEST, SCENES, SceneFolder
from bench.support.timing import QUICK, Effort, geometric_mean
from wive import _cpu

KERNELS = ("avx512", "avx2")
PARTS = ("speed", "packets", "build", "tree")
BUILD_THREADS = (1, 2)
IN_FLIGHT = (1, TUNED)
RAYS = 65_536  # of each kind and scene
EFFORT, BUILD_EFFORT = Effort(least=5, most=9), Effort(least=3, most=7)
QUICK_RAYS = 16_384

SPEED_COLUMNS = [
    "scene", "triangles", "accuracy", "kernel", "in_flight", "nodes", "rays", "count", "ratio", "low", "high",
    "wive_mrays", "embree_mrays", "rounds", "mismatches",
]  # fmt: skip
PACKET_COLUMNS = [
    "scene", "triangles", "accuracy", "kernel", "rays", "count", "width", "ratio", "low", "high",
    "wive_mrays", "embree_mrays", "rounds", "mismatches",
]  # fmt: skip
PROGRESS = ("scene", "accuracy", "kernel", "in_flight", "nodes", "rays", "ratio")
MEAN_COLUMNS = ["accuracy", "kernel", "in_flight", "nodes", "rays", "mean", "lowest", "lowest_scene"]
BUILD_COLUMNS = [
    "scene", "triangles", "accuracy", "threads", "ratio", "low", "high", "wive_seconds", "embree_seconds",
    "rounds",
]  # fmt: skip
TREE_COLUMNS = [
    "scene", "triangles", "accuracy", "sah_ratio", "wive_sah", "embree_sah", "bytes_ratio", "wive_bytes",
    "embree_bytes", "embree_allocated", "wive_nodes", "embree_nodes", "wive_depth", "embree_depth",
]  # fmt: skip


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, (*SCENES, LARGEST))
    kernels = usable_kernels(chosen.kernels)
    ways = product(kernels, chosen.in_flight, chosen.nodes)
    # Node forms differ in the memory they read, not by instruction set: one kernel is enough for the others.
    contenders = [Contender(*way) for way in ways if way[0] == kernels[0] or way[2] == chosen.nodes[0]]
    speed: list[report.Row] = []
    packets: list[report.Row] = []
    build: list[report.Row] = []
    trees: list[report.Row] = []
    for name in scenes.names:
        mesh = folder.load(name)
        sets = []
        if "speed" in chosen.parts:
            recorded = recorded_rays(mesh)
            sets = [recorded[kind].thinned(QUICK_RAYS if chosen.quick else RAYS) for kind in chosen.rays]
        accuracy = chosen.accuracy[-1]  # both accuracies build the same tree
        if "tree" in chosen.parts:
            trees.append(tree_row(mesh, accuracy, contenders[0].isa))
        if "build" in chosen.parts:
            effort = QUICK if chosen.quick else BUILD_EFFORT
            build += build_rows(mesh, accuracy, contenders[0].isa, BUILD_THREADS, effort)
        if "speed" in chosen.parts:
            for accuracy in chosen.accuracy:
                effort = QUICK if chosen.quick else EFFORT
                for row in speed_rows(mesh, accuracy, contenders, sets, effort, chosen.ftz):
                    speed.append(row)
                    report.print_progress(row, PROGRESS)
        if "packets" in chosen.parts:
            rays = recorded_rays(mesh)["primary"]
            effort = QUICK if chosen.quick else EFFORT
            for kernel, accuracy in product(kernels, chosen.accuracy):
                for row in packet_rows(mesh, accuracy, kernel, rays, effort, chosen.ftz):
                    packets.append(row)
                    report.print_progress(row, ("scene", "accuracy", "kernel", "width", "ratio"))

    means = mean_rows(speed)
    report.print_table(speed, SPEED_COLUMNS, "Speed, one thread: Embree's seconds over wive's")
    report.print_table(means, MEAN_COLUMNS, "Speed over all scenes: geometric mean and lowest")
    report.print_table(packets, PACKET_COLUMNS, "Primary rays: seconds of Embree's packets over wive's")
    report.print_table(build, BUILD_COLUMNS, "Build, equal threads: Embree's seconds over wive's")
    report.print_table(
        trees, TREE_COLUMNS, "Trees, wive's over Embree's: SAH relative to the root, bytes per triangle"
    )
    content = {
        "flush_denormals": chosen.ftz,
        "intersectors": sorted({row["intersector"] for row in trees}),
        "speed": speed,
        "means": means,
        "packets": packets,
        "build": build,
        "trees": trees,
    }
    whole = scenes.whole and is_whole(chosen, kernels)
    report.save("embree", content, chosen.out, whole=whole)


def mean_rows(speed: Sequence[report.Row]) -> list[report.Row]:
    """Geometric mean and lowest ratio over scenes, per accuracy, contender and kind of rays or all kinds."""
    rows = []
    for key, group in grouped(speed, ("accuracy", "kernel", "in_flight", "nodes")):
        kinds = list(dict.fromkeys(row["rays"] for row in group))
        for kind in [*kinds, "all"]:
            chosen = [row for row in group if kind in ("all", row["rays"])]
            lowest = min(chosen, key=lambda row: float(row["ratio"]))
            rows.append(
                {
                    **key,
                    "rays": kind,
                    "mean": geometric_mean([row["ratio"] for row in chosen]),
                    "lowest": lowest["ratio"],
                    "lowest_scene": lowest["scene"],
                }
            )
    return rows


def usable_kernels(names: Sequence[str]) -> list[str]:
    """The kernels that this machine can run; says which it leaves out and why."""
    known = _cpu.kernels()
    usable = []
    for name in names:
        reason = known.get(name, f"there is no such kernel: {', '.join(known)}")
        if reason:
            print(f"leaving out kernel {name!r}: {reason}", file=sys.stderr)
        else:
            usable.append(name)
    if not usable:
        raise BenchError("this machine can run none of these kernels")
    return usable


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("embree", __doc__)
    parser.add_argument(
        "--kernels", type=listed(), default=KERNELS, help="wive's kernels, e.g. avx512.full,avx2"
    )
    parser.add_argument(
        "--in-flight", type=in_flights, default=IN_FLIGHT, help="rays interleaved per thread, e.g. 1,32,tuned"
    )
    parser.add_argument("--nodes", type=listed(NODES), default=NODES, help=", ".join(NODES))
    parser.add_argument("--accuracy", type=listed(ACCURACIES), default=ACCURACIES, help=", ".join(ACCURACIES))
    parser.add_argument("--rays", type=listed(KINDS), default=KINDS, help=", ".join(KINDS))
    parser.add_argument("--parts", type=listed(PARTS), default=PARTS, help=", ".join(PARTS))
    parser.add_argument(
        "--ftz", action="store_true", help="flush denormals to zero on both sides; kept by default"
    )
    return parser.parse_args(options)


def is_whole(chosen: argparse.Namespace, kernels: Sequence[str]) -> bool:
    """Whether these options and kernels measure everything that the docs quote, scenes aside."""
    everything = {
        "in_flight": IN_FLIGHT,
        "nodes": NODES,
        "accuracy": ACCURACIES,
        "rays": KINDS,
        "parts": PARTS,
    }
    complete = all(set(getattr(chosen, name)) >= set(values) for name, values in everything.items())
    return complete and set(kernels) >= set(KERNELS) and not chosen.quick
