"""Rays of files in pieces, all cores: the seconds that one batch in memory takes over those of a stream.

Above 1 the stream is faster. "read" is `wive.stream` of an .npy file, the others are `wive.trace` of a file
to a file; "all" is every hit. In memory, arrays of rays are there before and hits stay there. Files are read
from the page cache. What is written is deleted after each round; the system writes it to the disk meanwhile.
"""

import argparse
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

import wive
from bench.support import report
from bench.support.options import scene_parser
from bench.support.rays import random_rays
from bench.support.scenes import SceneFolder
from bench.support.timing import QUICK, Effort, compare, wall_timed

USUAL = ("terrain_jacksboro", "city_san_francisco")
QUICK_SCENES = ("terrain_2k",)
COLUMNS = ["scene", "triangles", "form", "mrays", "ratio", "low", "high"]
Query = Literal["intersect", "intersect_all"]
# Name, rays, output and query; no output: read alone.
FORMS: tuple[tuple[str, str, str, Query], ...] = (
    ("read", "rays.npy", "", "intersect"),
    ("npy to npz", "rays.npy", "hits.npz", "intersect"),
    ("npy to folder", "rays.npy", "hits/", "intersect"),
    ("npz to npz", "rays.npz", "hits.npz", "intersect"),
    ("all, npy to npz", "rays.npy", "hits.npz", "intersect_all"),
)


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    scenes = SceneFolder(chosen.scene_dir).select(chosen.scenes, QUICK_SCENES if chosen.quick else USUAL)
    effort = QUICK if chosen.quick else Effort(least=3, most=5)
    count = 20_000 if chosen.quick else 1 << 22
    rows: list[report.Row] = []
    for name in scenes.names:
        mesh = SceneFolder(chosen.scene_dir).load(name)
        scene = wive.Scene(mesh.vertices, mesh.faces)
        rays = random_rays(mesh, count, np.random.default_rng(17))
        with tempfile.TemporaryDirectory() as folder:
            np.save(Path(folder, "rays.npy"), np.column_stack(rays))
            np.savez(Path(folder, "rays.npz"), origins=rays[0], directions=rays[1])
            for form in FORMS:
                rows.append(row_of(name, scene, rays, Path(folder), form, effort))
                report.print_progress(rows[-1], COLUMNS)
    report.print_table(rows, COLUMNS, "Streams, all cores: seconds of one batch in memory over the stream's")
    whole = scenes.whole and not chosen.quick
    report.save("stream", {"rays": count, "rows": rows}, chosen.out, whole=whole)


def row_of(
    name: str,
    scene: wive.Scene,
    rays: tuple[Any, Any],
    folder: Path,
    form: tuple[str, str, str, Query],
    effort: Effort,
) -> report.Row:
    """One scene and form of files."""
    label, source, output, query = form

    def stream() -> None:
        if not output:
            for _ in wive.stream(scene, folder / source):
                pass
            return
        wive.trace(scene, folder / source, f"{folder}/{output}", query=query)

    def streamed() -> float:
        seconds = wall_timed(stream)()
        if output:
            made = folder / output
            shutil.rmtree(made) if made.is_dir() else made.unlink()
        return seconds

    found = compare(streamed, wall_timed(lambda: getattr(scene, query)(*rays)), effort)
    return {
        "scene": name,
        "triangles": len(scene),
        "form": label,
        "mrays": len(rays[0]) / found.our_seconds / 1e6,
        "ratio": found.ratio,
        "low": found.low,
        "high": found.high,
    }


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    return scene_parser("stream", __doc__).parse_args(options)
