"""The cost of five orders of visiting a node's children: steps per ray and speed, on one tree.

Repeats the comparison of WiVe (Fuetterling et al., HPG 2017). `treelet` is the paper's order, from the split
axes of the treelet behind each node and the signs of the ray; `diagonal` sorts children along the diagonal
of the ray's octant; `slots` is the order of Ylitie, Karras and Laine (2017): the builder assigns each child
one of eight slots, by the assignment with the least total cost over all octants, and slots are visited by
slot number xor the ray's octant; `none` shuffles the children; `distance` sorts the children hit by their
entry distance, the work that the other orders save. Closest hits only: order matters little for any hit.
`other_hits` counts rays whose t differs from that of the distance order (rounding at the face of a box).

Speed is relative to `treelet`, measured in turn on one pinned core. One kernel follows all stored orders,
`slots` among them, so their speeds differ by steps alone; a kernel for `slots` without an order row would
save one load per node. `distance` has its own kernel, which sorts eight keys by a bitonic network.
"""

import argparse
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from bench.contenders import order_study
from bench.contenders.compiled_shim import BenchError
from bench.contenders.embree_race import TUNED
from bench.contenders.order_study import SORTING, STORED_ORDERS, Order
from bench.support import report
from bench.support.groups import mean_rows
from bench.support.options import listed, scene_parser
from bench.support.rays import Rays, recorded_rays
from bench.support.scenes import Mesh, SceneFolder
from bench.support.timing import QUICK, Effort, compare_in_turn, one_core, timed
from wive import _cpu

DISTANCE = "distance"
COUNTING_KERNEL = "scalar"
DISTANCE_KERNEL = "scalar.distance"
TIMED_RAYS = 131_072
IN_FLIGHT = (1, TUNED)
KINDS = ("primary", "diffuse")
COUNTERS = ("inner_nodes", "leaves", "triangles")
RELATIVE = ("nodes_vs_distance", "triangles_vs_distance")
SPEED_COLUMNS = [
    "scene", "faces", "rays", "count", "in_flight", "order", "kernel", "speed", "low", "high", "mrays",
    "rounds",
]  # fmt: skip
COLUMNS = ["scene", "faces", "rays", "count", "order", *COUNTERS, *RELATIVE, "other_hits"]
QUICK_RAYS = 16_384
Trees = dict[Order, _cpu.Bvh]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes)
    rows: list[report.Row] = []
    speed: list[report.Row] = []
    for name in scenes.names:
        mesh = folder.load(name)
        trees = {order: order_study.tree(mesh.vertices, mesh.faces, "fast", order) for order in STORED_ORDERS}
        check_same_tree(list(trees.values()), mesh.name)
        recorded = recorded_rays(mesh)
        sets = [
            recorded[kind].thinned(QUICK_RAYS) if chosen.quick else recorded[kind] for kind in chosen.rays
        ]
        rows += scene_rows(mesh, trees, sets)
        speed += speed_rows(mesh, trees, sets, QUICK if chosen.quick else Effort())
        print(f"{name}: done", flush=True)
    means = mean_rows(rows, ("rays", "order"), RELATIVE)
    speed_means = mean_rows(speed, ("rays", "in_flight", "order"), ("speed",))
    report.print_table(
        rows, COLUMNS, "Per ray, on one tree; relative columns: 1 is as good as true distance order"
    )
    report.print_table(means, ["rays", "order", *RELATIVE], "Geometric means")
    report.print_table(speed, SPEED_COLUMNS, "Speed, relative to the treelet order")
    report.print_table(speed_means, ["rays", "in_flight", "order", "speed"], "Geometric means")
    whole = scenes.whole and not chosen.quick and set(chosen.rays) == set(KINDS)
    content = {"rows": rows, "means": means, "speed": speed, "speed_means": speed_means}
    report.save("order", content, chosen.out, whole=whole)


def scene_rows(mesh: Mesh, trees: Trees, sets: Sequence[Rays]) -> Iterator[report.Row]:
    """Steps: one row per set of rays and order."""
    walks = {DISTANCE: (trees["treelet"], DISTANCE_KERNEL)}
    walks |= {order: (tree, COUNTING_KERNEL) for order, tree in trees.items()}
    for rays in sets:
        nearest_t, nearest = _trace(*walks[DISTANCE], rays)
        for order, walk in walks.items():
            t, counters = _trace(*walk, rays)
            yield {
                "scene": mesh.name,
                "faces": len(mesh.faces),
                "rays": rays.kind,
                "count": len(rays),
                "order": order,
                **counters,
                "nodes_vs_distance": counters["inner_nodes"] / nearest["inner_nodes"],
                "triangles_vs_distance": counters["triangles"] / nearest["triangles"],
                "other_hits": int(np.count_nonzero(t != nearest_t)),
            }


def speed_rows(mesh: Mesh, trees: Trees, sets: Sequence[Rays], effort: Effort) -> Iterator[report.Row]:
    """Speed: one row per set of rays, number in flight and order."""
    unusable = _cpu.kernels()
    sorting, stored = next(
        pair for pair in SORTING.items() if not unusable[pair[1]]
    )  # the best pair that runs
    walks: dict[str, tuple[_cpu.Bvh, str]] = {order: (tree, stored) for order, tree in trees.items()}
    walks[DISTANCE] = (trees["treelet"], sorting)
    for rays in (rays.thinned(TIMED_RAYS) for rays in sets):
        for in_flight in IN_FLIGHT:

            def trace(walk: tuple[_cpu.Bvh, str], rays: Rays = rays, in_flight: int = in_flight) -> None:
                closest(*walk, rays, in_flight=in_flight)

            runs = [timed(lambda walk=walk: trace(walk)) for walk in walks.values()]  # type: ignore[misc]
            with one_core():
                for run in runs:
                    run()
                outcomes = compare_in_turn(runs, effort)
            for (order, (_, kernel)), outcome in zip(walks.items(), outcomes, strict=True):
                yield {
                    "scene": mesh.name,
                    "faces": len(mesh.faces),
                    "rays": rays.kind,
                    "count": len(rays),
                    "in_flight": in_flight or "tuned",
                    "order": order,
                    "kernel": kernel,
                    "speed": outcome.ratio,
                    "low": outcome.low,
                    "high": outcome.high,
                    "mrays": len(rays) / outcome.our_seconds * 1e-6,
                    "rounds": outcome.rounds,
                }


def closest(
    tree: _cpu.Bvh, kernel: str, rays: Rays, in_flight: int = 0, stats: bool = False
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float32], NDArray[np.int32] | None]:
    """t, prim, uv and, if `stats`, steps, on one thread."""
    if kernel in SORTING:
        return order_study.intersect(kernel, tree, *rays.arrays, in_flight=in_flight, stats=stats)
    return tree.intersect(kernel, *rays.arrays, threads=1, in_flight=in_flight, stats=stats)


def _trace(tree: _cpu.Bvh, kernel: str, rays: Rays) -> tuple[NDArray[np.float32], dict[str, float]]:
    """Each ray's t, and the counters' means."""
    t, _, _, stats = closest(tree, kernel, rays, stats=True)
    assert stats is not None
    means = stats.mean(axis=0, dtype=np.float64).tolist()
    return t, dict(zip(COUNTERS, means, strict=True))


def check_same_tree(trees: Sequence[_cpu.Bvh], name: str) -> None:
    """Raises BenchError if the trees differ in more than their order words (the last row of each node)."""
    first = trees[0]
    for tree in trees[1:]:
        alike = np.array_equal(first.nodes[:, :7], tree.nodes[:, :7]) and np.array_equal(
            first.blocks, tree.blocks
        )
        if not alike:
            raise BenchError(f"trees of {name} differ in more than their order")


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("order", __doc__)
    parser.add_argument("--rays", type=listed(KINDS), default=KINDS, help=", ".join(KINDS))
    return parser.parse_args(options)
