"""One mesh that moves in a scene: `refit(geom=)`, refit of all, a new scene, a second scene with moved rays.

The mesh that moves is a piece of terrain, a fifth as wide as the scene, in its middle. Times are medians on
all cores, in milliseconds; `held_ms` is that of `refit(geom=)` while hits of before are alive, `first_ms`
that of the first one. `two_scenes` is the seconds of a million random rays through two scenes, the rays
moved to the second one's place by NumPy, over those through one scene of both meshes.
"""

import argparse
from collections.abc import Callable, Sequence

import numpy as np

import wive
from bench.support import report
from bench.support.options import scene_parser
from bench.support.rays import random_rays
from bench.support.scenes import Mesh, SceneFolder, terrain
from bench.support.timing import QUICK, Effort, compare, wall_timed

USUAL = ("city_san_francisco", "bathroom_salledebain", "bmw_m6_tiled_3x2")
QUICK_SCENES = ("terrain_2k",)
MOVING, QUICK_MOVING = (5_000, 20_000, 800_000), (200,)
SIZE = 0.2  # of the scene's
RAYS, QUICK_RAYS = 1_000_000, 1_000
MOVES, QUICK_MOVES = 21, 3
COLUMNS = [
    "scene", "triangles", "moving", "geom_ms", "held_ms", "first_ms", "refit_ms", "build_ms", "two_scenes",
]  # fmt: skip


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, QUICK_SCENES if chosen.quick else USUAL)
    rows: list[report.Row] = []
    for name in scenes.names:
        mesh = folder.load(name)
        for count in QUICK_MOVING if chosen.quick else MOVING:
            rows.append(row_of(mesh, count, chosen.quick))
            report.print_progress(rows[-1], COLUMNS)
    report.print_table(rows, COLUMNS, "One mesh moves")
    whole = scenes.whole and not chosen.quick
    report.save("moving", {"rows": rows}, chosen.out, whole=whole)


def row_of(mesh: Mesh, count: int, quick: bool) -> report.Row:
    """A scene, and a piece of terrain of about `count` triangles that moves in it."""
    guest = terrain(count)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    start, end = guest.vertices.min(axis=0), guest.vertices.max(axis=0)
    scale = SIZE * (high - low).max() / (end - start).max()
    points = np.ascontiguousarray((guest.vertices - start) * scale + (low + high) / 2, np.float32)
    step = 1e-3 * (high - low).astype(np.float32)
    scene = wive.Scene.from_meshes([(mesh.vertices, mesh.faces), (points, guest.faces)])
    places = iter(points + k * step for k in range(1_000))
    moves = QUICK_MOVES if quick else MOVES

    def seconds(work: Callable[[], object], times: int) -> float:
        return float(np.median([wall_timed(work)() for _ in range(times)]))

    def move() -> None:
        scene.refit(next(places), geom=1)

    first = seconds(move, 1)
    row: report.Row = {"scene": mesh.name, "triangles": len(scene), "moving": len(guest.faces)}
    row["geom_ms"] = 1e3 * seconds(move, moves)
    held = []
    for _ in range(moves):
        hits = scene.intersect(low, step)
        held.append(wall_timed(move)())
        del hits
    all_vertices = scene.vertices.copy()
    row |= {
        "held_ms": 1e3 * float(np.median(held)),
        "first_ms": 1e3 * first,
        "refit_ms": 1e3 * seconds(lambda: scene.refit(all_vertices), 3),
        "build_ms": 1e3 * seconds(lambda: wive.Scene(scene.vertices, scene.faces), 3),
    }
    row["two_scenes"] = two_scenes(mesh, scene, (points, guest.faces), quick)
    return row


def two_scenes(mesh: Mesh, one: wive.Scene, guest: tuple[np.ndarray, np.ndarray], quick: bool) -> float:
    """Seconds of rays through a scene each, over those through one scene."""
    origins, directions = random_rays(mesh, QUICK_RAYS if quick else RAYS, np.random.default_rng(1))
    still, moving = wive.Scene(mesh.vertices, mesh.faces), wive.Scene(*guest)
    back = np.linalg.inv(np.diag((1.0, 1.0, 1.0, 1.0)) + 0.01 * np.eye(4, k=3)).astype(np.float32)

    def through_two() -> None:
        first = still.intersect(origins, directions)
        moved = origins @ back[:3, :3].T + back[:3, 3], directions @ back[:3, :3].T
        second = moving.intersect(*moved, tmax=first.t)
        np.where(second.mask, second.t, first.t)

    effort = QUICK if quick else Effort(least=3, most=7)
    return compare(
        wall_timed(lambda: one.intersect(origins, directions)), wall_timed(through_two), effort
    ).ratio


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    return scene_parser("moving", __doc__).parse_args(options)
