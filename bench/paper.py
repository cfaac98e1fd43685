"""The WiVe paper's comparison repeated: path tracing with its traversals and with Embree's, per scene.

Fuetterling, Lojewski, Pfreundt, Hamann, Ebert: "Accelerated Single Ray Tracing for Wide Vector Units", HPG
2017, compares two forms with Embree's single rays: `half` on AVX-512 and `full` on AVX2. As there, one
renderer traces diffuse paths of up to eight bounces off screen at 3840 x 2160, and only the traversal
differs. To save time only --rows whole rows, spread evenly over the picture, are rendered, with --samples
paths per pixel. Each row is rendered by wive, then by Embree held to the same instruction set, on one pinned
core; `gain` is the median over rows of Embree's seconds over wive's, less one, in percent, shading included
on both sides; `total_gain` is the gain over all rows together. One ray in flight is the paper's algorithm;
`tuned` is wive's default for batches, which here have --samples x 32 rays, fewer at each bounce.
`differing` is the share of pixels that differ; `mean_difference` is the mean difference of the pictures
relative to their mean, 0 in a closed room that is black; `ray_difference` is the relative difference of the
numbers of rays traced. All are near 0 if both sides find the same hits.

The paper's own tables, on other scenes and processors, are at doi.org/10.1145/3105762.3105785.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from bench.contenders.embree_race import TUNED, Contender, embree_tree
from bench.contenders.native_embree import EmbreeMesh
from bench.embree import usable_kernels
from bench.support import report
from bench.support.groups import grouped
from bench.support.options import ACCURACIES, Accuracy, in_flights, listed, scene_parser
from bench.support.scenes import Mesh, SceneFolder
from bench.support.timing import Comparison, geometric_mean, one_core
from wive import _cpu
from wive.camera import Camera

WIDTH, HEIGHT = 3840, 2160
QUICK_WIDTH, QUICK_HEIGHT = 192, 108
BOUNCES = 8
ROWS, QUICK_ROWS = 10, 4
SAMPLES = 16
KERNELS = ("avx512.half", "avx512.full", "avx2")  # the paper's two, and full on AVX-512
IN_FLIGHT = (1, TUNED)
# If pictures or numbers of rays differ by more, the sides did not do the same work, and the bench says so.
LARGEST_DIFFERENCE = 0.01

COLUMNS = [
    "scene", "triangles", "accuracy", "kernel", "in_flight", "gain", "low", "high", "total_gain",
    "wive_mrays", "embree_mrays", "rows", "differing", "mean_difference", "ray_difference",
]  # fmt: skip
MEAN_COLUMNS = ["accuracy", "kernel", "in_flight", "mean_gain", "lowest", "highest"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    kernels = usable_kernels(chosen.kernels)
    contenders = [Contender(kernel, in_flight) for kernel in kernels for in_flight in chosen.in_flight]
    rows: list[report.Row] = []
    scenes = folder.select(chosen.scenes)
    for name in scenes.names:
        mesh = folder.load(name)
        for accuracy in chosen.accuracy:
            for row in scene_rows(mesh, accuracy, contenders, chosen):
                rows.append(row)
                report.print_progress(row, ("scene", "accuracy", "kernel", "in_flight", "gain", "differing"))
                difference = max(row["mean_difference"], row["ray_difference"])
                if difference > LARGEST_DIFFERENCE:
                    print(
                        f"{name}: the two pictures or their rays differ by {difference:.1%}", file=sys.stderr
                    )
    means = mean_rows(rows)
    what = (
        f"{chosen.width} x {chosen.height}, {chosen.rows} rows, {chosen.samples} samples, {BOUNCES} bounces"
    )
    report.print_table(rows, COLUMNS, f"Path tracing, gain over Embree's single rays in percent: {what}")
    report.print_table(means, MEAN_COLUMNS, "Over all scenes, in percent")
    content = {
        "width": chosen.width,
        "height": chosen.height,
        "samples": chosen.samples,
        "bounces": BOUNCES,
        "rows": rows,
        "means": means,
    }
    whole = scenes.whole and is_whole(chosen, kernels)
    report.save("paper", content, chosen.out, whole=whole)


def scene_rows(
    mesh: Mesh, accuracy: Accuracy, contenders: Sequence[Contender], chosen: argparse.Namespace
) -> Iterator[report.Row]:
    """One row of results per contender."""
    tree = _cpu.Bvh(mesh.vertices, mesh.faces, accuracy)
    for isa in dict.fromkeys(contender.isa for contender in contenders):
        with embree_tree(mesh, accuracy, isa) as theirs:
            theirs.commit()
            for contender in (one for one in contenders if one.isa == isa):
                yield {
                    "scene": mesh.name,
                    "triangles": len(mesh.faces),
                    "accuracy": accuracy,
                    "kernel": contender.kernel,
                    "in_flight": contender.in_flight or "tuned",
                    "isa": isa,
                    **race(mesh, tree, theirs, contender, chosen),
                }


def race(
    mesh: Mesh, tree: _cpu.Bvh, theirs: EmbreeMesh, contender: Contender, chosen: argparse.Namespace
) -> report.Row:
    """Renders the rows in turn by both; columns of speed and of difference."""
    camera = Camera(mesh.camera.eye, mesh.camera.target, mesh.camera.up, mesh.camera.fov)
    frame = camera.frame(chosen.width, chosen.height)
    size = (chosen.height, chosen.width, 3)
    picture, their_picture = np.zeros(size, np.float32), np.zeros(size, np.float32)
    places = ((np.arange(chosen.rows) + 0.5) / chosen.rows * chosen.height).astype(int).tolist()

    def render(image: NDArray[np.float32], row: int, tracer: tuple[int, int] | None) -> tuple[float, int]:
        start = time.process_time()
        rays = tree.render_rows(
            contender.kernel, frame, image, row, row + 1, chosen.samples, BOUNCES, "gray", threads=1,
            in_flight=contender.in_flight, tracer=tracer, check=False,
        )  # fmt: skip
        return time.process_time() - start, rays

    with one_core():
        render(picture, places[0], None)
        render(their_picture, places[0], theirs.tracer)  # both warmed up
        pairs = [(render(picture, row, None), render(their_picture, row, theirs.tracer)) for row in places]
    our_seconds, their_seconds = ([pair[side][0] for pair in pairs] for side in (0, 1))
    our_rays, their_rays = (sum(pair[side][1] for pair in pairs) for side in (0, 1))
    outcome = Comparison.of(our_seconds, their_seconds)
    difference = np.abs(picture[places] - their_picture[places])
    mean = float(picture[places].mean(dtype=np.float64))
    return {
        "gain": percent(outcome.ratio),
        "low": percent(outcome.low),
        "high": percent(outcome.high),
        "total_gain": percent(sum(their_seconds) / sum(our_seconds)),
        "wive_mrays": our_rays / sum(our_seconds) * 1e-6,
        "embree_mrays": their_rays / sum(their_seconds) * 1e-6,
        "rows": len(places),
        "differing": float((difference.max(axis=-1) > 1e-6).mean()),
        "mean_difference": float(difference.mean(dtype=np.float64)) / mean if mean else 0.0,
        "ray_difference": abs(our_rays / their_rays - 1),
    }


def percent(ratio: float) -> float:
    """The part of a ratio above one, in percent."""
    return 100 * (ratio - 1)


def mean_rows(rows: Sequence[report.Row]) -> list[report.Row]:
    """Geometric mean and range of the gain over scenes, per accuracy, kernel and rays in flight."""
    means = []
    for key, group in grouped(rows, ("accuracy", "kernel", "in_flight")):
        gains = [row["gain"] for row in group]
        mean = percent(geometric_mean([1 + gain / 100 for gain in gains]))
        means.append(
            {
                **key,
                "mean_gain": mean,
                "lowest": min(gains),
                "highest": max(gains),
            }
        )
    return means


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("paper", __doc__)
    parser.add_argument(
        "--kernels", type=listed(), default=KERNELS, help="wive's kernels, e.g. avx512.half,avx2"
    )
    parser.add_argument(
        "--in-flight", type=in_flights, default=IN_FLIGHT, help="rays in flight, e.g. 1,tuned"
    )
    parser.add_argument("--accuracy", type=listed(ACCURACIES), default=ACCURACIES, help=", ".join(ACCURACIES))
    parser.add_argument("--rows", type=int, help=f"rows of the picture that are rendered; default {ROWS}")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="paths per pixel")
    chosen = parser.parse_args(options)
    chosen.width, chosen.height = (QUICK_WIDTH, QUICK_HEIGHT) if chosen.quick else (WIDTH, HEIGHT)
    chosen.rows = chosen.rows or (QUICK_ROWS if chosen.quick else ROWS)
    if not 1 <= chosen.rows <= chosen.height or chosen.samples < 1:
        parser.error(f"expected 1 to {chosen.height} rows and at least one sample")
    return chosen


def is_whole(chosen: argparse.Namespace, kernels: Sequence[str]) -> bool:
    """Whether these options and kernels measure everything that the docs quote, scenes aside."""
    everything = {"in_flight": IN_FLIGHT, "accuracy": ACCURACIES}
    complete = all(set(getattr(chosen, name)) >= set(values) for name, values in everything.items())
    return complete and set(kernels) >= set(KERNELS) and not chosen.quick and chosen.rows >= ROWS
