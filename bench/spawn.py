"""What hits cost after the trace: spawn, points, normals and error bounds over the trace's own time.

Rays leave the hits of a picture in all directions, as those of ambient occlusion: `intersect_ns` and
`occluded_ns` are nanoseconds per ray of both queries. `spawn`, `points`, `normals` and `error_bound` are
their seconds, for the hits of such rays, over those of `scene.intersect`; `of_occluded` is spawn's over those
of `scene.occluded`.
"""

from collections.abc import Callable, Sequence

import numpy as np

import wive
from bench.support import report
from bench.support.options import scene_parser
from bench.support.rays import camera_rays
from bench.support.scenes import Mesh, SceneFolder
from bench.support.timing import QUICK, Effort, compare_in_turn, one_core, timed
from wive._internal.precision import Floats

USUAL = ("living_room", "city_san_francisco", "terrain_jacksboro", "bmw_m6")
QUICK_SCENES = ("terrain_2k",)
SIDE, QUICK_SIDE = 512, 64
PARTS = ("spawn", "points", "normals", "error_bound")
COLUMNS = ["scene", "precision", "hits", "intersect_ns", "occluded_ns", *PARTS, "of_occluded"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = scene_parser("spawn", __doc__).parse_args(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, QUICK_SCENES if chosen.quick else USUAL)
    rows: list[report.Row] = []
    with one_core():
        for name in scenes.names:
            for dtype in (np.float32, np.float64):
                rows.append(row_of(folder.load(name), dtype, chosen.quick))
                report.print_progress(rows[-1], COLUMNS)
    report.print_table(rows, COLUMNS, "What follows a trace, one core: parts of its seconds")
    report.save("spawn", {"rows": rows}, chosen.out, whole=scenes.whole and not chosen.quick)


def row_of(mesh: Mesh, dtype: type, quick: bool) -> report.Row:
    """A scene in one precision."""
    scene = wive.Scene(mesh.vertices.astype(dtype), mesh.faces)
    random = np.random.default_rng(5)
    origins, directions = camera_rays(mesh.camera, QUICK_SIDE if quick else SIDE, random)
    first = scene.intersect(origins.astype(dtype), directions.astype(dtype), threads=1)
    seen = np.flatnonzero(first.mask)
    ball = random.standard_normal((len(seen), 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    towards_eye = np.where(first.front[seen, None], 1, -1) * first.normals()[seen]
    onwards: Floats = np.ascontiguousarray(towards_eye + ball, dtype)
    starts = scene.spawn(first.prim[seen], first.uv[seen], onwards)
    hits = scene.intersect(starts, onwards, threads=1)

    works: list[Callable[[], object]] = [
        lambda: scene.intersect(starts, onwards),
        lambda: scene.occluded(starts, onwards),
        lambda: hits.spawn(onwards),
        lambda: hits.points(),
        lambda: hits.normals(),
        lambda: hits.error_bound,
    ]
    found = compare_in_turn([timed(work) for work in works], QUICK if quick else Effort(least=5, most=9))
    _, occluded, *parts = found
    trace = occluded.their_seconds
    return {
        "scene": mesh.name,
        "precision": scene.precision,
        "hits": len(seen),
        "intersect_ns": trace / len(seen) * 1e9,
        "occluded_ns": occluded.our_seconds / len(seen) * 1e9,
        **{name: 1 / part.ratio for name, part in zip(PARTS, parts, strict=True)},
        "of_occluded": occluded.ratio / parts[0].ratio,
    }
