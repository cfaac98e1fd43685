"""Closest points and insides, one core: wive against Open3D and trimesh, with the same points.

Points lie evenly in the scene's box ("volume"), or a hundredth of its size off the surface ("surface").
`open3d` and `trimesh` are their seconds over wive's, from NumPy arrays to NumPy arrays. The cells of a
library that can't be imported, or that lacks a package, are empty, and a line on standard error says why.
trimesh gets a thousandth of the points. `contains` is trimesh's `mesh.contains` by embreex over
`scene.contains`, for a closed mesh.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import wive
from bench.support import report
from bench.support.options import scene_parser
from bench.support.scenes import SceneFolder
from bench.support.timing import QUICK, Effort, compare, one_core, timed

USUAL = ("living_room", "city_san_francisco", "terrain_jacksboro", "bmw_m6")
QUICK_SCENES = ("terrain_2k",)
KINDS = ("volume", "surface")
OFF_SURFACE = 0.01  # of the scene's size
Query = Callable[[], Any]
LIBRARIES = ("open3d", "trimesh")
COLUMNS = ["scene", "triangles", "kind", "wive_ns", *LIBRARIES]
CONTAINS = ["triangles", "points", "wive_seconds", "contains"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    scenes = SceneFolder(chosen.scene_dir).select(chosen.scenes, QUICK_SCENES if chosen.quick else USUAL)
    effort = QUICK if chosen.quick else Effort(least=3, most=5)
    count = 2_000 if chosen.quick else 50_000
    rows: list[report.Row] = []
    others = usable()
    with one_core():
        for name in scenes.names:
            mesh = SceneFolder(chosen.scene_dir).load(name)
            for kind in KINDS:
                rows.append(row_of(name, mesh.vertices, mesh.faces, kind, count, effort, others))
                report.print_progress(rows[-1], COLUMNS)
        insides = [inside_row(3 if chosen.quick else 6, 20 * count, effort)]
    report.print_table(rows, COLUMNS, "Closest points, one core: their seconds over wive's")
    report.print_table(
        insides, CONTAINS, "Points inside a closed mesh, one core: trimesh's seconds over wive's"
    )
    content = {"rows": rows, "contains": insides}
    whole = scenes.whole and not chosen.quick
    report.save("closest", content, chosen.out, whole=whole)


def usable() -> dict[str, Callable[..., Query]]:
    """What asks each other library, by its name; standard error says what the others need."""
    found: dict[str, Callable[..., Query]] = {}
    for name, make in zip(LIBRARIES, (open3d_query, trimesh_query), strict=True):
        try:
            make(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]]), np.ones((1, 3), np.float32))()
        except (ImportError, OSError) as error:
            print(f"bench closest: no column {name}: {error}", file=sys.stderr)
        else:
            found[name] = make
    return found


def row_of(
    name: str,
    vertices: np.ndarray,
    faces: np.ndarray,
    kind: str,
    count: int,
    effort: Effort,
    others: dict[str, Callable[..., Query]],
) -> report.Row:
    """One scene and kind of points."""
    points = points_of(vertices, faces, kind, count)
    scene = wive.Scene(vertices, faces)

    def ours(some: np.ndarray) -> Callable[[], float]:
        return timed(lambda: scene.closest(some, threads=1))

    alone = min(ours(points)() for _ in range(3))
    row: report.Row = {"scene": name, "triangles": len(faces), "kind": kind, "wive_ns": alone / count * 1e9}
    row |= dict.fromkeys(LIBRARIES)
    for library, make in others.items():
        some = points[:: max(1, count // 50)] if library == "trimesh" else points
        row[library] = compare(ours(some), timed(make(vertices, faces, some)), effort).ratio
    return row


def points_of(vertices: np.ndarray, faces: np.ndarray, kind: str, count: int) -> Any:
    """(count,3) float32, always the same."""
    random = np.random.default_rng(16)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    if kind == "volume":
        return (low + (high - low) * random.random((count, 3))).astype(np.float32)
    corners = vertices[faces[random.integers(len(faces), size=count)]]
    places = (corners * random.dirichlet((1, 1, 1), count)[..., None]).sum(axis=1)
    return (places + OFF_SURFACE * (high - low).max() * random.standard_normal((count, 3))).astype(np.float32)


def open3d_query(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> Query:
    """Open3D's closest points on one thread."""
    import open3d

    tensor = open3d.core.Tensor
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(tensor(vertices.astype(np.float32)), tensor(faces.astype(np.uint32)))
    return lambda: scene.compute_closest_points(tensor(points), nthreads=1)["points"].numpy()


def trimesh_query(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> Query:
    """trimesh's closest points, whose tree is made."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    query: Callable[..., Any] = trimesh.proximity.closest_point
    query(mesh, points[:1])  # makes the tree
    return lambda: query(mesh, points)


def inside_row(level: int, count: int, effort: Effort) -> report.Row:
    """Points inside a bumpy ball: trimesh with embreex against wive."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=level)
    ball.vertices *= 1 + 0.1 * np.sin(8 * ball.vertices).prod(axis=1, keepdims=True)
    scene = wive.Scene(ball.vertices.astype(np.float32), ball.faces)
    points = np.random.default_rng(3).uniform(-1.1, 1.1, (count, 3))
    ball.contains(points[:1])
    found = compare(
        timed(lambda: scene.contains(points, threads=1)), timed(lambda: ball.contains(points)), effort
    )
    return {
        "triangles": len(ball.faces),
        "points": count,
        "wive_seconds": found.our_seconds,
        "contains": found.ratio,
    }


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    return scene_parser("closest", __doc__).parse_args(options)
