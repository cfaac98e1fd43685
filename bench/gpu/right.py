"""Section `right`: what each kernel finds on hard rays, against the C++ core, bit for bit."""

from typing import Any

import numpy as np

from bench.gpu.forms import Options, right_trees
from bench.gpu.rays import hard_rays
from bench.gpu.session import Lanes, Session, differing
from bench.support.report import Row

RAYS, FEW_RAYS = 20_001, 501
SEED = 5
UP = (0.0, 0.0, 1.0)


def run(session: Session) -> Row:
    """One row per tree and lane form: by name, how many numbers differ."""
    rows = []
    for name, options in right_trees(session):
        lane_forms: tuple[Lanes, ...] = (8,) if session.quick else (1, 8)
        for lanes in lane_forms:
            row = {"scene": name, **options._asdict(), "lanes": lanes}
            try:
                row |= {"wrong": wrong_numbers(session, name, options, lanes)}
            except Exception as problem:  # a kernel that fails is a result, and others go on
                row |= {"wrong": None, "failed": f"{type(problem).__name__}: {problem}"[:300]}
            rows.append(row)
            print("right", row, flush=True)
    return {
        "rays": session.count(RAYS, FEW_RAYS),
        "bad": sum(row["wrong"] != {} for row in rows),
        "rows": rows,
    }


def wrong_numbers(session: Session, name: str, options: Options, lanes: Lanes) -> dict[str, int]:
    """How many numbers of each answer differ from the core's; only answers that do."""
    core, scene = session.core(name, *options), session.scene(name, *options)
    vertices, faces = session.vertices(name, options.precision), session.mesh(name).faces
    rays = hard_rays(vertices, faces, session.count(RAYS, FEW_RAYS), SEED)
    on_device = session.upload(rays[0]), session.upload(rays[1])
    right, right_steps = core.intersect(*rays, stats=True)
    hits, steps = scene.intersect(*on_device, lanes=lanes, stats=True)
    every, right_every = scene.intersect_all(*on_device, lanes=lanes), core.intersect_all(*rays)
    through_host = scene.intersect(*rays, lanes=lanes)
    answers: dict[str, tuple[Any, Any]] = {
        "points": (hits.points(), right.points()),
        "normals": (hits.normals(), right.normals()),
        "spawn": (hits.spawn(np.array(UP, vertices.dtype)), right.spawn(np.array(UP, vertices.dtype))),
        "any": (scene.occluded(*on_device, lanes=lanes), core.occluded(*rays)),
        "count": (scene.count(*on_device, lanes=lanes), core.count(*rays)),
    }
    for key in ("t", "prim", "uv", "mask", "error_bound"):
        answers[key] = getattr(hits, key), getattr(right, key)
    for key in ("offsets", "t", "prim", "uv"):
        answers[f"all {key}"] = getattr(every, key), getattr(right_every, key)
    for key in ("t", "prim"):
        answers[f"NumPy {key}"] = getattr(through_host, key), getattr(right, key)
    for key, mine, theirs in zip(("inner nodes", "leaves", "triangles"), steps, right_steps, strict=True):
        answers[f"steps: {key}"] = mine, theirs
    counts = {key: differing(_on_host(mine), truth) for key, (mine, truth) in answers.items()}
    return {key: count for key, count in counts.items() if count}


def _on_host(array: Any) -> Any:
    return array.numpy() if hasattr(array, "numpy") else array
