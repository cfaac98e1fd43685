"""Speed of accuracies, node forms and precisions relative to `fast`, on scenes: for `bench pareto`."""

from collections.abc import Iterator, Sequence

from bench.contenders.pareto_contenders import wive_contenders
from bench.contenders.speeds import speeds
from bench.support import report
from bench.support.groups import grouped
from bench.support.rays import recorded_rays
from bench.support.scenes import Mesh
from bench.support.timing import Effort, geometric_mean

SCENES = (
    "living_room", "staircase", "terrain_jacksboro", "bmw_m6", "bathroom_salledebain", "furball_embree_tubes",
)  # fmt: skip
QUICK_SCENES = ("terrain_2k",)
KINDS = ("primary", "diffuse", "random")
RAYS, QUICK_RAYS = 65_536, 4_096
WAYS = {"mrays": "in flight", "single": "one ray"}

COLUMNS = ["scene", "rays", "contender", "mrays", "single", "kept_mrays", "kept_single"]
MEAN_COLUMNS = ["contender", "mean_mrays", "lowest_mrays", "mean_single", "lowest_single"]


def scene_rows(mesh: Mesh, quick: bool, effort: Effort) -> Iterator[report.Row]:
    """One row per kind of rays and contender; `kept` is its speed over that of `fast`, measured in turn."""
    found = wive_contenders(mesh.vertices, mesh.faces)
    recorded = recorded_rays(mesh)
    for kind in KINDS:
        rays = recorded[kind].thinned(QUICK_RAYS if quick else RAYS)
        speed = speeds(found, (rays.origins, rays.directions), effort)
        for name, row in speed.items():
            kept = {f"kept_{way}": row[f"{way}_ratio"] / speed["fast"][f"{way}_ratio"] for way in WAYS}
            yield {
                "scene": mesh.name,
                "triangles": len(mesh.faces),
                "rays": kind,
                **row,
                **kept,
                "contender": name,
            }


def mean_rows(rows: Sequence[report.Row]) -> list[report.Row]:
    """Geometric mean and lowest of the shares kept, per contender."""
    means = []
    for key, mine in grouped(rows, ("contender",)):
        mean = {f"mean_{way}": geometric_mean([row[f"kept_{way}"] for row in mine]) for way in WAYS}
        lowest = {f"lowest_{way}": min(row[f"kept_{way}"] for row in mine) for way in WAYS}
        means.append({**key, **mean, **lowest})
    return means
