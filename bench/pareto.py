"""Speed against error: accuracies, node forms and float64, Embree's fast and robust modes, wp.mesh_query_ray.

A closed sphere of 81,920 triangles at five scales and five places. `leaks`: the share of rays aimed from
inside at its vertices and edges that miss. `wrong`: of rays in any direction, the share whose triangle is
not that of accuracy "exact" on the scalar backend, which the tests compare with exact rationals.
`t_median`, `t_worst`: the error of t against t in double, in units in the last place, over rays with the
right triangle. Speed is measured on the same rays and the unmoved sphere of radius 1, all contenders in turn
on one core; `mrays` with as many rays in flight as a batch gets, `single` with one. wive's trees are measured
on scenes as well: `kept` is the share of the speed of `fast`. Tables give shares in millionths (ppm).
`float64` is "watertight" over the same numbers as float64 vertices and rays.
"""

import argparse
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.contenders.pareto_contenders import CONTENDERS, Array, Contender, contenders, exact_prims
from bench.contenders.speeds import speeds
from bench.support import report
from bench.support.options import scene_parser
from bench.support.pareto_scenes import COLUMNS as SCENE_COLUMNS
from bench.support.pareto_scenes import MEAN_COLUMNS, QUICK_SCENES, SCENES, mean_rows, scene_rows
from bench.support.scenes import SceneFolder
from bench.support.timing import QUICK, Effort

SUBDIVISIONS, QUICK_SUBDIVISIONS = 6, 4
SCALES = (1e-6, 1e-3, 1.0, 1e3, 1e6)
PLACES = (1.0, 10.0, 100.0, 1000.0, 3000.0)  # distance of the centre, in radii along (3, -2, 1)
AIMED, QUICK_AIMED = 400_000, 20_000  # rays at vertices and edges, per case
FREE, QUICK_FREE = 131_072, 16_384  # rays in any direction
EFFORT = Effort(least=5, most=9)

COLUMNS = ["contender", "mrays", "single", "leaks_ppm", "wrong_ppm", "t_median", "t_worst"]
CASE_COLUMNS = ["contender", "scale", "place", "leaks_ppm", "wrong_ppm", "t_median", "t_worst"]


class Case(NamedTuple):
    """A sphere and its rays."""

    scale: float
    place: float
    vertices: Array
    faces: NDArray[np.int32]
    aimed: tuple[Array, Array]
    free: tuple[Array, Array]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, QUICK_SCENES if chosen.quick else SCENES)
    effort = QUICK if chosen.quick else EFFORT
    sweep = [(scale, 0.0) for scale in SCALES] + [(1.0, place) for place in PLACES]
    plain = sweep.index((1.0, 0.0))
    if chosen.quick:
        sweep, plain = [(1.0, 0.0), (1.0, PLACES[2])], 0
    cases = [case(*place, chosen.quick) for place in sweep]
    rows: list[report.Row] = []
    for number, asked in enumerate(cases):
        right = exact_prims(asked.vertices, asked.faces, *asked.free)
        exact_t = distances(asked, right)
        found, missing = contenders(asked.vertices, asked.faces)
        for one in found:
            rows.append({"contender": one.name, "scale": asked.scale, "place": asked.place})
            rows[-1] |= errors(one, asked, right, exact_t)
        if number == plain:
            speed = speeds(found, asked.free, effort)
        for one in found:
            one.release()
        report.print_progress({"scale": asked.scale, "place": asked.place}, ("scale", "place"))
    means = [{**speed[name], **total(rows, name)} for name in speed]
    report.print_table(in_ppm(rows), CASE_COLUMNS, "Errors by scale and place of the sphere")
    report.print_table(
        in_ppm(means), COLUMNS, "Speed on one core, Mray/s, and errors over all scales and places"
    )
    for name in missing:
        print(f"not here: {name}")
    on_scenes = [row for name in scenes.names for row in scene_rows(folder.load(name), chosen.quick, effort)]
    scene_means = mean_rows(on_scenes)
    report.print_table(on_scenes, SCENE_COLUMNS, "On scenes: Mray/s, and the share of the speed of fast")
    report.print_table(scene_means, MEAN_COLUMNS, "Share of the speed of fast, over scenes and rays")
    cost = float64_cost(speed)
    print(f"float64 / float32, both watertight: {cost['mrays']:.3f} in flight, {cost['single']:.3f} single")
    content = {
        "means": means,
        "rows": rows,
        "missing": missing,
        "triangles": len(cases[0].faces),
        "float64_to_float32": cost,
        "scenes": on_scenes,
        "scene_means": scene_means,
    }
    whole = scenes.whole and not chosen.quick and not missing
    report.save("pareto", content, chosen.out, whole=whole)


def case(scale: float, place: float, quick: bool) -> Case:
    """The sphere of radius `scale`, its centre `place` radii away, and rays from inside, seeded."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=QUICK_SUBDIVISIONS if quick else SUBDIVISIONS)
    away = scale * place * np.array([3.0, -2.0, 1.0])
    vertices = np.ascontiguousarray(ball.vertices * scale + away, np.float32)
    faces = np.ascontiguousarray(ball.faces, np.int32)
    random = np.random.default_rng(7)
    aimed, free = (QUICK_AIMED, QUICK_FREE) if quick else (AIMED, FREE)
    ends = vertices[faces[random.integers(len(faces), size=aimed)]].astype(np.float64)
    weight = random.random((aimed, 1)) * random.integers(2, size=(aimed, 1))
    targets = ends[:, 0] * (1 - weight) + ends[:, 1] * weight

    def origins(count: int) -> Array:
        return np.asarray(away + 0.4 * scale * random.uniform(-1, 1, (count, 3)), np.float32)

    starts, free_starts = origins(aimed), origins(free)
    directions = (scale * random.standard_normal((free, 3))).astype(np.float32)
    return Case(
        scale,
        place,
        vertices,
        faces,
        (starts, (targets - starts).astype(np.float32)),
        (free_starts, directions),
    )


def distances(asked: Case, prim: NDArray[np.int32]) -> NDArray[np.float64]:
    """(n,) t at which each free ray meets the plane of its triangle, in double."""
    origins, directions = (array.astype(np.float64) for array in asked.free)
    a, b, c = asked.vertices[asked.faces[prim]].astype(np.float64).swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    t = ((a - origins) * normal).sum(axis=1) / (directions * normal).sum(axis=1)
    return np.asarray(t)


def errors(one: Contender, asked: Case, right: NDArray[np.int32], t: NDArray[np.float64]) -> report.Row:
    """Leaks, wrong triangles and the error of t of one contender in one case."""
    _, aimed_prim = one.trace(*asked.aimed)
    found_t, prim = one.trace(*asked.free)
    same = prim == right
    ulp = np.abs(found_t[same] - t[same]) / np.spacing(t[same].astype(np.float32))
    return {
        "leaks": float(np.mean(aimed_prim < 0)),
        "wrong": float(np.mean(~same)),
        "t_median": float(np.median(ulp)),
        "t_worst": float(ulp.max()),
        "aimed": len(aimed_prim),
        "free": len(prim),
    }


def total(rows: Sequence[report.Row], name: str) -> report.Row:
    """Mean rates, the median of the medians and the worst t of one contender over all cases."""
    mine = [row for row in rows if row["contender"] == name]
    rates = {key: float(np.mean([row[key] for row in mine])) for key in ("leaks", "wrong")}
    median = float(np.median([row["t_median"] for row in mine]))
    return {**rates, "t_median": median, "t_worst": max(row["t_worst"] for row in mine)}


def in_ppm(rows: Sequence[report.Row]) -> list[report.Row]:
    """Rows with shares in millionths, as three decimals would show small shares as zero."""
    return [{**row, **{f"{key}_ppm": 1e6 * row[key] for key in ("leaks", "wrong")}} for row in rows]


def float64_cost(speed: dict[str, report.Row]) -> dict[str, float]:
    """Speed of float64 over that of float32, in flight and with single rays."""
    double, single = speed["float64"], speed["watertight"]
    return {way: double[f"{way}_ratio"] / single[f"{way}_ratio"] for way in ("mrays", "single")}


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("pareto", __doc__)
    parser.epilog = "contenders: " + ", ".join(CONTENDERS)
    return parser.parse_args(options)
