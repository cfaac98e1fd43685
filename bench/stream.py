"""Rays of files in pieces, all cores: the seconds that one batch in memory takes over those of a stream.

Above 1 the stream is faster. "read" is `wive.stream` of an .npy file, the others are `wive.trace` of a file
to a file, which ends when the output is on the disk; "all" is every hit, of a quarter of the rays; "one
thread" traces on one thread on both sides. In memory, arrays of rays are there before and hits stay there.
`work` is the same ratio of CPU seconds, on which other programs have less influence. Files are read from the
page cache. What is written is deleted after each round.
"""

import argparse
import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any, Literal, NamedTuple

import numpy as np

import wive
from bench.support import report
from bench.support.options import scene_parser
from bench.support.rays import random_rays
from bench.support.scenes import SceneFolder
from bench.support.timing import QUICK, Effort, compare, wall_timed

USUAL = ("terrain_jacksboro", "city_san_francisco")
QUICK_SCENES = ("terrain_2k",)
COLUMNS = ["scene", "triangles", "form", "mrays", "ratio", "low", "high", "work"]
Query = Literal["intersect", "intersect_all"]
RAYS, QUICK_RAYS = 1 << 23, 20_000


class Form(NamedTuple):
    """What is streamed."""

    name: str
    rays: str
    output: str  # "" if hits are not written
    query: Query = "intersect"
    threads: int | None = None


FORMS = (
    Form("read", "rays.npy", ""),
    Form("npy to npz", "rays.npy", "hits.npz"),
    Form("npy to folder", "rays.npy", "hits/"),
    Form("npz to npz", "rays.npz", "hits.npz"),
    Form("npy to npz, one thread", "rays.npy", "hits.npz", threads=1),
    Form("all, npy to npz", "few.npy", "hits.npz", "intersect_all"),
    Form("all, npy to folder", "few.npy", "hits/", "intersect_all"),
)


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    scenes = SceneFolder(chosen.scene_dir).select(chosen.scenes, QUICK_SCENES if chosen.quick else USUAL)
    effort = QUICK if chosen.quick else Effort(least=3, most=3)
    count = QUICK_RAYS if chosen.quick else RAYS
    rows: list[report.Row] = []
    for name in scenes.names:
        mesh = SceneFolder(chosen.scene_dir).load(name)
        scene = wive.Scene(mesh.vertices, mesh.faces)
        rays = random_rays(mesh, count, np.random.default_rng(17))
        with tempfile.TemporaryDirectory() as folder:
            np.save(Path(folder, "rays.npy"), np.column_stack(rays))
            np.save(Path(folder, "few.npy"), np.column_stack(rays)[: count // 4])
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
    form: Form,
    effort: Effort,
) -> report.Row:
    """One scene and form of files."""
    if form.query == "intersect_all":
        rays = rays[0][: len(rays[0]) // 4], rays[1][: len(rays[1]) // 4]

    def stream() -> None:
        if not form.output:
            for _ in wive.stream(scene, folder / form.rays, threads=form.threads):
                pass
            return
        output = f"{folder}/{form.output}"
        wive.trace(scene, folder / form.rays, output, query=form.query, threads=form.threads)

    work: dict[str, list[float]] = {"stream": [], "batch": []}  # seconds of CPU time

    def streamed() -> float:
        begin = time.process_time()
        seconds = wall_timed(stream)()
        work["stream"].append(time.process_time() - begin)
        if form.output:
            made = folder / form.output
            shutil.rmtree(made) if made.is_dir() else made.unlink()
        return seconds

    def batch() -> float:
        begin = time.process_time()
        seconds = wall_timed(lambda: getattr(scene, form.query)(*rays, threads=form.threads))()
        work["batch"].append(time.process_time() - begin)
        return seconds

    found = compare(streamed, batch, effort)
    return {
        "scene": name,
        "triangles": len(scene),
        "form": form.name,
        "mrays": len(rays[0]) / found.our_seconds / 1e6,
        "ratio": found.ratio,
        "work": median(work["batch"]) / median(work["stream"]),
        "low": found.low,
        "high": found.high,
    }


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    return scene_parser("stream", __doc__).parse_args(options)
