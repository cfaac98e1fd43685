"""Inputs on which the cost of a ray could jump: seconds per ray over those of a usual input.

`scale`: a ball of 0.5 mm triangles above a ground of 2 m to 200 km. `distance`: origins up to 1e6 radii from
that ball. `plane`: rays that lie in a large flat part, over rays across it. `doubt`: rays through vertices
and edges and coincident triangles in `exact`, over `fast`. `leaving`: rays that leave a scene of compressed
nodes from its outer side, over float32 nodes. `misses`: rays of which most miss the scene, over
Embree's robust single rays. `bar`: what `ratio` may be at most. Everything runs on one pinned core.
"""

import argparse
from collections.abc import Callable, Sequence

import numpy as np

import wive
from bench.contenders.native_embree import EmbreeMesh, Isa
from bench.support import report
from bench.support.cliffs import Cliff, Rays, cliffs
from bench.support.options import scene_parser
from bench.support.scenes import Mesh, SceneFolder
from bench.support.timing import QUICK, Effort, compare, one_core, timed
from wive import _cpu

LEVELS, QUICK_LEVELS = 7, 4  # 20 * 4^levels triangles of the ball
RAYS, QUICK_RAYS = 3000, 300
MISSES, QUICK_MISSES = 100_000, 10_000
MISS_BAR = 1 / 1.5
SPREAD = 4.0  # size of the box in which rays start that mostly miss, over that of the scene
EFFORT = Effort(least=5, most=15)
COLUMNS = ["part", "case", "ratio", "bar", "ray_us", "usual_us", "missing", "rounds"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes)
    rows: list[report.Row] = []

    def add(row: report.Row) -> None:
        rows.append(row)
        report.print_progress(row, ("part", "case", "ratio", "bar"))

    effort = QUICK if chosen.quick else EFFORT
    for cliff in cliffs(QUICK_RAYS if chosen.quick else RAYS, QUICK_LEVELS if chosen.quick else LEVELS):
        add(measured(cliff, effort))
    for name in scenes.names:
        for row in misses(folder.load(name), QUICK_MISSES if chosen.quick else MISSES, effort):
            add(row)
    report.print_table(rows, COLUMNS, "Seconds per ray over those of a usual input")
    above = [row for row in rows if row["ratio"] > row["bar"]]
    print(f"{len(above)} of {len(rows)} above their bar")
    content = {"backend": backend(), "above": len(above), "rows": rows}
    report.save("cliffs", content, chosen.out, whole=scenes.whole and not chosen.quick)


def backend() -> str:
    """The backend that scenes have here."""
    return wive.Scene(np.eye(3, dtype=np.float32), [[0, 1, 2]]).backend


def measured(cliff: Cliff, effort: Effort) -> report.Row:
    """Closest hits of one input and of the usual one, in turn."""
    ours, usual = (closest_hits(rays) for rays in (cliff.near, cliff.rays))
    with one_core():
        outcome = compare(timed(ours), timed(usual), effort)
    count, usual_count = len(cliff.rays.origins), len(cliff.near.origins)
    return {
        "part": cliff.part,
        "case": cliff.case,
        "ratio": outcome.ratio * usual_count / count,
        "bar": cliff.bar,
        "ray_us": outcome.their_seconds / count * 1e6,
        "usual_us": outcome.our_seconds / usual_count * 1e6,
        "rounds": outcome.rounds,
    }


def closest_hits(rays: Rays) -> Callable[[], None]:
    """A function that traces the rays once; it has run before."""
    scene = wive.Scene(rays.vertices, rays.faces, accuracy=rays.accuracy, nodes=rays.nodes)
    tree = _cpu.Bvh(rays.vertices, rays.faces, rays.accuracy, nodes=rays.nodes)
    limits = np.zeros(1, rays.origins.dtype), np.full(1, np.inf, rays.origins.dtype)

    def trace() -> None:
        if rays.one_by_one:
            tree.intersect(scene.backend, rays.origins, rays.directions, *limits, threads=1, in_flight=1)
        else:
            scene.intersect(rays.origins, rays.directions, threads=1)

    trace()
    return trace


def misses(mesh: Mesh, count: int, effort: Effort) -> list[report.Row]:
    """Closest and any hit of rays that start around the scene, wive and Embree in turn."""
    random = np.random.default_rng(3)
    low, high = (
        corner.astype(np.float64) for corner in (mesh.vertices.min(axis=0), mesh.vertices.max(axis=0))
    )
    middle, half = (low + high) / 2, (high - low) / 2
    origins = middle + random.uniform(-SPREAD, SPREAD, (count, 3)) * half
    origins = origins[(np.abs(origins - middle) > half).any(axis=1)].astype(np.float32)
    directions = random.normal(size=origins.shape).astype(np.float32)
    limits = np.zeros(1, np.float32), np.full(1, np.inf, np.float32)
    tree, kernel = _cpu.Bvh(mesh.vertices, mesh.faces, "watertight"), backend()
    isa: Isa = "avx512" if kernel == "avx512" else "avx2"
    rows = []
    with EmbreeMesh(mesh.vertices, mesh.faces, isa=isa, robust=True) as embree, one_core():
        embree.commit()
        for query in ("intersect", "occluded"):
            ours, theirs = getattr(tree, query), getattr(embree, query)
            found = ours(kernel, origins, directions, *limits, threads=1)
            missing = float((found[1] < 0 if query == "intersect" else ~found[0]).mean())
            theirs(origins, directions, *limits)
            outcome = compare(
                timed(lambda: theirs(origins, directions, *limits)),  # noqa: B023 - runs at once
                timed(lambda: ours(kernel, origins, directions, *limits, threads=1)),  # noqa: B023
                effort,
            )
            rows.append(
                {
                    "part": "misses",
                    "case": f"{mesh.name}, {query}",
                    "ratio": outcome.ratio,
                    "bar": MISS_BAR,
                    "ray_us": outcome.their_seconds / len(origins) * 1e6,
                    "usual_us": outcome.our_seconds / len(origins) * 1e6,
                    "missing": missing,
                    "rounds": outcome.rounds,
                }
            )
    return rows


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    return scene_parser("cliffs", __doc__).parse_args(options)
