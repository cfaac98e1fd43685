"""Section `fast`: closest hits per second against wp.mesh_query_ray with each of Warp's builders."""

import time
from typing import Any

import numpy as np

from bench.contenders.mesh_query_ray import MeshQuery
from bench.gpu.forms import FAST_TREES, fast_forms
from bench.gpu.rays import Set, ray_sets
from bench.gpu.session import Session
from bench.support.report import Row
from wive.warp_kernels import launch_closest

RAYS, FEW_RAYS = 2_000_000, 2000
CHECKED = 20_000  # rays whose triangle is compared with the core's
BUILDERS = ("sah", "cubql", "lbvh")
BLOCKS = (128, 256)
LEAST_SECONDS = 60.0  # left of the budget when another set of rays may begin


def run(session: Session) -> list[Row]:
    """One row per scene, set of rays and kernel."""
    rows: list[Row] = []
    for name in session.names:
        mesh = session.mesh(name)
        queries: dict[str, tuple[MeshQuery, float]] = {}
        for builder in BUILDERS if session.on_gpu else BUILDERS[:1]:
            start = time.perf_counter()
            query = MeshQuery(mesh, session.device, builder)
            session.synchronize()
            queries[builder] = query, time.perf_counter() - start
        for kind, rays in ray_sets(mesh, session.core(name), session.count(RAYS, FEW_RAYS)).items():
            if session.seconds_left() < LEAST_SECONDS:
                return rows
            found = rows_of(session, name, rays, queries)
            rows += [{"scene": name, "triangles": len(mesh.faces), "rays": kind, **row} for row in found]
            print("fast", name, kind, {row["kernel"]: round(row["mrays"], 1) for row in found}, flush=True)
    return rows


def rows_of(session: Session, name: str, rays: Set, queries: dict[str, tuple[MeshQuery, float]]) -> list[Row]:
    """Every kernel on one set of rays: its speed, and how many triangles differ from the core's."""
    count = len(rays[0])
    origins, directions = session.upload(rays[0]), session.upload(rays[1])
    limits, outputs = session.limits(), session.outputs(count)
    some = np.random.default_rng(2).integers(count, size=min(count, CHECKED))
    truth = session.core(name).intersect(rays[0][some], rays[1][some]).prim
    hit = float((truth >= 0).mean())
    rows: list[Row] = []

    def add(kernel: str, block: int, work: Any, **more: Any) -> None:
        seconds = session.device_seconds(work)
        differs = int(np.count_nonzero(outputs[1].numpy()[some] != truth))
        row = {"kernel": kernel, "block": block, "count": count, "hit": hit, "mrays": count / seconds / 1e6}
        rows.append({**row, "differs": differs, **more})

    for builder, (query, build) in queries.items():
        for block in BLOCKS:

            def trace(query: MeshQuery = query, block: int = block) -> None:
                query.launch(origins, directions, *outputs, block_dim=block)

            add(f"mesh_query_ray {builder}", block, trace, build=build)
    for options in FAST_TREES:
        tree = session.scene(name, *options).tree
        for lanes, block in fast_forms(session, options):

            def work(tree: Any = tree, lanes: Any = lanes, block: int = block) -> None:
                launch_closest(tree, origins, directions, *limits, *outputs, lanes=lanes, block_dim=block)

            add(f"wive {options.accuracy} {options.nodes} L{lanes}", block, work, bytes=tree.memory)
    return rows
