"""Trees of quality="high" over those of quality="medium": steps per ray, SAH cost, bytes, build time.

A step is an inner node visited or a block of four triangles tested; counts are exact and the same on every
machine. The mean is over equally many primary, diffuse and random rays. Build time is CPU time on one thread,
both qualities in turn.
"""

import argparse
from collections.abc import Sequence

from bench.support import report
from bench.support.options import scene_parser
from bench.support.rays import Rays, recorded_rays
from bench.support.scenes import Mesh, SceneFolder
from bench.support.timing import QUICK, Effort, compare, geometric_mean, timed
from wive import _cpu

KINDS = ("primary", "diffuse", "random")
KERNEL = "scalar"  # the kernel that every machine has
RAYS, QUICK_RAYS = 65_536, 4096
STEPS = [f"{kind}_steps" for kind in (*KINDS, "mean")]
COLUMNS = ["scene", "triangles", *STEPS, "sah", "bytes", "depth", "build_time"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    rows = []
    scenes = folder.select(chosen.scenes)
    for name in scenes.names:
        mesh = folder.load(name)
        recorded = recorded_rays(mesh)
        sets = [recorded[kind].thinned(QUICK_RAYS if chosen.quick else RAYS) for kind in KINDS]
        rows.append(scene_row(mesh, sets, QUICK if chosen.quick else Effort()))
        report.print_progress(rows[-1], ("scene", "mean_steps", "build_time"))
    means = {
        column: geometric_mean([row[column] for row in rows]) for column in (*STEPS, "sah", "build_time")
    }
    report.print_table(rows, COLUMNS, "quality='high' over quality='medium'")
    report.print_table([means], list(means), "Geometric means")
    whole = scenes.whole and not chosen.quick
    report.save("quality", {"rows": rows, "means": means}, chosen.out, whole=whole)


def scene_row(mesh: Mesh, sets: Sequence[Rays], effort: Effort) -> report.Row:
    """Both trees of one mesh."""

    def high() -> _cpu.Bvh:
        return _cpu.Bvh(mesh.vertices, mesh.faces, threads=1, quality="high")

    def medium() -> _cpu.Bvh:
        return _cpu.Bvh(mesh.vertices, mesh.faces, threads=1)

    better, usual = high(), medium()
    ratios = {f"{rays.kind}_steps": steps(better, rays) / steps(usual, rays) for rays in sets}
    both = sum(steps(better, rays) for rays in sets) / sum(steps(usual, rays) for rays in sets)
    return {
        "scene": mesh.name,
        "triangles": len(mesh.faces),
        **ratios,
        "mean_steps": both,
        "sah": sum(better.sah) / sum(usual.sah),
        "bytes": better.memory / usual.memory,
        "depth": better.depth,
        "build_time": 1 / compare(timed(high), timed(medium), effort).ratio,
    }


def steps(tree: _cpu.Bvh, rays: Rays) -> float:
    """Mean steps per ray."""
    stats = tree.intersect(KERNEL, *rays.arrays, stats=True)[-1]
    assert stats is not None
    nodes, _, triangles = stats.mean(axis=0, dtype=float).tolist()
    return float(nodes + triangles / 4)


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    return scene_parser("quality", __doc__).parse_args(options)
