"""Batches of pictures from near and far with packets, over the same batches without.

Cameras look at the middle of each scene from 0.1 to 100 diagonals away, with a field of view that the scene
fills. `ratio`: seconds of a batch as it comes over the lesser of the seconds with 15 rays in flight and with
one, for which no packets are formed; all three in turn on one pinned core. Above 1 packets lose. The views
where they seem to lose most are measured again, for longer: the worst of 400 measurements is mostly noise.
"""

import argparse
from collections.abc import Sequence
from itertools import product

import numpy as np

from bench.support import report
from bench.support.options import ACCURACIES, numbers, scene_parser
from bench.support.rays import Rays, camera_rays
from bench.support.scenes import Camera, Mesh, SceneFolder
from bench.support.timing import Effort, compare_in_turn, one_core, timed
from wive import _cpu

DISTANCES = (0.1, 0.5, 3.0, 30.0, 100.0)  # from the middle of the scene, in diagonals of its bounding box
WIDTHS = (16, 128, 512, 2048)  # pixels of square pictures
QUERIES = ("closest", "any")
FROM = np.array([0.6, 0.45, 0.75]) / np.linalg.norm([0.6, 0.45, 0.75])  # direction of the camera
WIDEST = 45.0  # degrees, for cameras so near that the scene would fill more
WITHOUT_PACKETS = 15  # rays in flight: one fewer than a packet has
FEWEST_RAYS = 30_000  # that a timing traces: a small batch is repeated
EFFORT, QUICK_EFFORT = Effort(least=5, most=9), Effort(least=2, most=2)
LONG_EFFORT, LONG = Effort(least=3, most=3), 1_000_000  # of batches from so many rays on, which scatter less
SECOND_EFFORT, SUSPECT = Effort(least=31, most=31), 1.05  # for ratios above this one
COLUMNS = ["scene", "distance", "width", "query", "ratio", "ray_ns", "flights_ns", "single_ns", "rounds"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes)
    kernel = chosen.kernel or usable_kernels()[0]
    rows: list[report.Row] = []
    for name in scenes.names:
        mesh = folder.load(name)
        tree = _cpu.Bvh(mesh.vertices, mesh.faces, chosen.accuracy)
        for distance, width, query in product(DISTANCES, chosen.widths, QUERIES):
            rays = view(mesh, distance, width)
            effort = QUICK_EFFORT if chosen.quick else LONG_EFFORT if len(rays) >= LONG else EFFORT
            figures = measured(tree, kernel, rays, query, effort)
            if figures["ratio"] > SUSPECT and not chosen.quick:
                figures = measured(tree, kernel, rays, query, SECOND_EFFORT)
            rows.append({"scene": name, "distance": distance, "width": width, "query": query, **figures})
            report.print_progress(rows[-1], ("scene", "distance", "width", "query", "ratio"))
    report.print_table(rows, COLUMNS, "Seconds with packets over seconds without")
    ratios = np.array([row["ratio"] for row in rows])
    summary = {"worst": ratios.max(), "best": ratios.min(), "mean": float(np.exp(np.log(ratios).mean()))}
    report.print_table([summary], list(summary))
    content = {"kernel": kernel, "accuracy": chosen.accuracy, "summary": summary, "rows": rows}
    whole = scenes.whole and not (chosen.quick or chosen.kernel) and chosen.widths == WIDTHS
    report.save("packets", content, chosen.out, whole=whole)


def view(mesh: Mesh, distance: float, width: int) -> Rays:
    """The rays of a square picture from so many diagonals away, row by row."""
    low, high = mesh.vertices.min(axis=0).astype(np.float64), mesh.vertices.max(axis=0).astype(np.float64)
    middle = (low + high) / 2
    eye = middle + FROM * distance * mesh.diagonal
    fov = min(WIDEST, float(np.degrees(2 * np.arctan(0.5 / distance))))
    camera = Camera(tuple(eye), tuple(middle), (0.1, 0.2, 1.0), fov)
    origins, directions = camera_rays(camera, width, np.random.default_rng(0))
    return Rays("primary", origins, directions, np.zeros(1, np.float32), np.full(1, np.inf, np.float32))


def measured(tree: _cpu.Bvh, kernel: str, rays: Rays, query: str, effort: Effort) -> report.Row:
    """One view: as it comes, with rays in flight but no packets, and ray by ray."""
    trace = tree.occluded if query == "any" else tree.intersect
    times = max(1, FEWEST_RAYS // len(rays))

    def batch(in_flight: int) -> None:
        for _ in range(times):
            trace(kernel, *rays.arrays, threads=1, in_flight=in_flight)

    ways = (0, WITHOUT_PACKETS, 1)
    runs = [timed(lambda k=k: batch(k)) for k in ways]  # type: ignore[misc]
    with one_core():
        for run in runs:
            run()
        outcomes = compare_in_turn(runs, effort)
    packets, flights, single = (outcome.our_seconds / (times * len(rays)) * 1e9 for outcome in outcomes)
    ratio = max(outcomes[1].ratio, outcomes[2].ratio)  # to the faster of the two
    return {
        "ratio": ratio,
        "ray_ns": packets,
        "flights_ns": flights,
        "single_ns": single,
        "rounds": outcomes[0].rounds,
    }


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("packets", __doc__)
    parser.add_argument(
        "--kernel", choices=usable_kernels(), help="one of wive's kernels; default: the best here"
    )
    parser.add_argument("--accuracy", choices=ACCURACIES, default="watertight", help="accuracy of the tree")
    parser.add_argument(
        "--widths", type=numbers, default=WIDTHS, help="pixels of square pictures, e.g. 16,512"
    )
    return parser.parse_args(options)


def usable_kernels() -> list[str]:
    """The kernels that run here."""
    return [name for name, reason in _cpu.kernels().items() if not reason]
