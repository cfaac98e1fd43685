"""Fuzzed scenes in every form that a scene has, and the results of every query as bits."""

import numpy as np

import wive
from support.batches import Batch
from support.odd_scenes import odd_case

# Dtypes of vertices and rays, accuracy, node form.
FORMS = {
    "fast": (np.float32, np.float32, "fast", "float32"),
    "watertight": (np.float32, np.float32, "watertight", "float32"),
    "compressed": (np.float32, np.float32, "watertight", "compressed"),
    "exact": (np.float32, np.float32, "exact", "float32"),
    "float64": (np.float64, np.float64, "watertight", "float32"),
    "float64 compressed": (np.float64, np.float64, "watertight", "compressed"),
    "float64 rays": (np.float32, np.float64, "watertight", "float32"),
    "float64 rays, exact": (np.float32, np.float64, "exact", "compressed"),
}
Results = dict[str, bytes]


def case_of(seed: int, form: str) -> Batch:
    dtype, ray_dtype, *_ = FORMS[form]
    return odd_case(seed, dtype, ray_dtype=ray_dtype)


def scene_of(case: Batch, form: str, backend: str = "auto", quality: str = "medium") -> wive.Scene:
    *_, accuracy, nodes = FORMS[form]
    return wive.Scene(
        case.vertices, case.faces, backend=backend, accuracy=accuracy, nodes=nodes, quality=quality
    )


def answers(scene: wive.Scene, case: Batch, **work: int) -> Results:
    """Every query's results as bits."""
    rays = case[2:]
    hits, many = scene.intersect(*rays, **work), scene.intersect_all(*rays, **work)
    touched = scene.intersect_all(*rays, touching=True, **work)
    results = {
        "t": hits.t, "prim": hits.prim, "uv": hits.uv, "occluded": scene.occluded(*rays, **work),
        "count": scene.count(*rays, **work), "offsets": many.offsets, "all t": many.t, "all prim": many.prim,
        "all uv": many.uv, "touched": touched.offsets, "touched t": touched.t, "touched prim": touched.prim,
    }  # fmt: skip
    return {name: np.ascontiguousarray(array).tobytes() for name, array in results.items()}


def different(one: Results, other: Results) -> list[str]:
    return [name for name in one if one[name] != other[name]]
