"""Section `shadow`: any hit, Mray/s against wp.mesh_query_ray_anyhit on the tree that traces best."""

import warp as wp

from bench.contenders.mesh_query_ray import MeshQuery
from bench.gpu.rays import Set, ray_sets
from bench.gpu.session import Session
from bench.support.report import Row
from wive.warp_kernels import launch_any

RAYS, FEW_RAYS = 1_000_000, 1000
KINDS = ("diffuse", "random")
LEAST_SECONDS = 30.0  # left of the budget when another scene may begin


def run(session: Session) -> list[Row]:
    """One row per scene and set of rays."""
    rows: list[Row] = []
    for name in session.names:
        if session.seconds_left() < LEAST_SECONDS:
            break
        sets = ray_sets(session.mesh(name), session.core(name), session.count(RAYS, FEW_RAYS))
        for kind in KINDS:
            if kind in sets:
                rows.append({"scene": name, "rays": kind, **raced(session, name, sets[kind])})
                print("shadow", rows[-1], flush=True)
    return rows


def raced(session: Session, name: str, rays: Set) -> Row:
    """Both on one set of rays."""
    count = len(rays[0])
    origins, directions = session.upload(rays[0]), session.upload(rays[1])
    blocked = wp.empty(count, dtype=wp.bool, device=session.device)
    tree, query, limits = (
        session.scene(name).tree,
        MeshQuery(session.mesh(name), session.device),
        session.limits(),
    )
    ours = session.device_seconds(lambda: launch_any(tree, origins, directions, *limits, blocked))
    theirs = session.device_seconds(lambda: query.launch_any(origins, directions, blocked))
    row = {"count": count, "wive_mrays": count / ours / 1e6, "mesh_query_ray_mrays": count / theirs / 1e6}
    return {**row, "ratio": theirs / ours}
