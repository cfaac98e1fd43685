"""What the order of visiting a node's children costs: inner nodes, leaves and triangles per ray, on one tree.

Redoes the comparison of WiVe (Fuetterling et al., HPG 2017). `treelet` is the paper's order, from the split
axes of the treelet behind each node and the signs of the ray; `diagonal` sorts children along the diagonal of
the ray's octant; `none` shuffles them; `distance` sorts the children hit by their true entry
distance, the work that the others spare. Closest hits only: for any-hit queries order matters little.
`other_hits` counts rays whose t differs from that of the distance order (rounding at the face of a box).
"""

import argparse
from collections.abc import Iterator, Sequence
from typing import Literal

import matplotlib
import numpy as np
from numpy.typing import NDArray

from bench import report
from bench.compiled_shim import BenchError
from bench.options import listed, scene_parser
from bench.rays import Rays, recorded_rays
from bench.scenes import Mesh, SceneFolder
from bench.timing import geometric_mean
from wive import _cpu

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.figure import Figure

Order = Literal["treelet", "diagonal", "none"]
STORED_ORDERS: tuple[Order, ...] = ("treelet", "diagonal", "none")
DISTANCE = "distance"
COUNTING_KERNEL = "scalar"
DISTANCE_KERNEL = "scalar.distance"
KINDS = ("primary", "diffuse")
COUNTERS = ("inner_nodes", "leaves", "triangles")
RELATIVE = ("nodes_vs_distance", "triangles_vs_distance")
COLUMNS = ["scene", "faces", "rays", "count", "order", *COUNTERS, *RELATIVE, "other_hits"]
QUICK_RAYS = 16_384


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    names = folder.check(chosen.scenes)
    rows: list[report.Row] = []
    for name in names:
        mesh = folder.load(name)
        recorded = recorded_rays(mesh)
        sets = [
            recorded[kind].thinned(QUICK_RAYS) if chosen.quick else recorded[kind] for kind in chosen.rays
        ]
        rows += scene_rows(mesh, sets)
        print(f"{name}: done", flush=True)
    means = mean_rows(rows)
    report.print_table(
        rows, COLUMNS, "Per ray, on one tree; relative columns: 1 is as good as true distance order"
    )
    report.print_table(means, ["rays", "order", *RELATIVE], "Geometric means")
    whole = not chosen.quick and not chosen.scenes and set(chosen.rays) == set(KINDS)
    report.save("order", {"rows": rows, "means": means}, draw(rows), chosen.out, whole=whole)


def scene_rows(mesh: Mesh, sets: Sequence[Rays]) -> Iterator[report.Row]:
    """One row per set of rays and order."""
    trees = {order: _cpu.Bvh(mesh.vertices, mesh.faces, "fast", order) for order in STORED_ORDERS}
    check_same_tree(list(trees.values()), mesh.name)
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


def _trace(tree: _cpu.Bvh, kernel: str, rays: Rays) -> tuple[NDArray[np.float32], dict[str, float]]:
    """Each ray's t, and the counters' means."""
    t, _, _, stats = tree.intersect(kernel, *rays.arrays, stats=True)
    assert stats is not None
    means = stats.mean(axis=0, dtype=np.float64).tolist()
    return t, dict(zip(COUNTERS, means, strict=True))


def check_same_tree(trees: Sequence[_cpu.Bvh], name: str) -> None:
    """Raises BenchError unless the trees are alike but for their order words (the last row of each node)."""
    first = trees[0]
    for tree in trees[1:]:
        alike = np.array_equal(first.nodes[:, :7], tree.nodes[:, :7]) and np.array_equal(
            first.blocks, tree.blocks
        )
        if not alike:
            raise BenchError(f"trees of {name} differ in more than their order")


def mean_rows(rows: Sequence[report.Row]) -> list[report.Row]:
    """Geometric means over scenes of the columns relative to the distance order."""
    means: list[report.Row] = []
    for kind, order in dict.fromkeys((row["rays"], row["order"]) for row in rows):
        group = [row for row in rows if (row["rays"], row["order"]) == (kind, order)]
        values = {column: geometric_mean([row[column] for row in group]) for column in RELATIVE}
        means.append({"rays": kind, "order": order, **values})
    return means


def draw(rows: Sequence[report.Row]) -> Figure:
    """Inner nodes per ray relative to the distance order: a panel per kind of rays, bars per scene."""
    kinds = list(dict.fromkeys(row["rays"] for row in rows))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure, panels = pyplot.subplots(
        1,
        len(kinds),
        figsize=(2.4 + 3.6 * len(kinds), 1.3 + 0.5 * len(scenes)),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    height = 0.8 / len(STORED_ORDERS)
    for kind, panel in zip(kinds, panels[0], strict=True):
        for i, order in enumerate(STORED_ORDERS):
            chosen = {
                row["scene"]: row["nodes_vs_distance"]
                for row in rows
                if (row["rays"], row["order"]) == (kind, order)
            }
            positions = [scenes.index(scene) + (i - 1) * height for scene in chosen]
            bars = panel.barh(positions, list(chosen.values()), height * 0.9, label=order, color=f"C{i}")
            panel.bar_label(bars, fmt="%.2f", fontsize=7, padding=2)
        panel.axvline(1.0, color="0.4", linewidth=1)
        panel.set_title(f"{kind} rays", fontsize=10)
        panel.set_xlabel("inner nodes per ray, relative to distance order", fontsize=9)
        panel.set_yticks(range(len(scenes)), scenes, fontsize=8)
        panel.set_ylim(len(scenes) - 0.5, -0.5)
        panel.margins(x=0.12)
        panel.tick_params(length=0, labelsize=8)
        panel.spines[["top", "right", "left"]].set_visible(False)
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=9)
    return figure


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("order", __doc__)
    parser.add_argument("--rays", type=listed(KINDS), default=KINDS, help=", ".join(KINDS))
    return parser.parse_args(options)
