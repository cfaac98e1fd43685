"""Section `small`: microseconds by batch size, of kernels on the device alone and of calls from Python."""

from collections.abc import Callable

import warp as wp

from bench.contenders.mesh_query_ray import MeshQuery
from bench.gpu.forms import SMALL_FORMS, forms
from bench.gpu.rays import Set, ray_sets
from bench.gpu.session import Session
from bench.support.report import Row
from wive.warp_kernels import launch_closest

SIZES = (1, 32, 256, 1024, 4096, 8192, 16_384, 32_768, 65_536, 131_072, 262_144)
FEW_SIZES = (1, 256)
IN_GRAPH = 20  # launches per graph, so that a replay's own cost hardly counts
CALLS, FEW_CALLS = 50, 5
QUERY_BLOCK = 64
LEAST_SECONDS = 45.0  # left of the budget when another size may begin


def run(session: Session) -> list[Row]:
    """Random rays in the first scene: one row per batch size and kernel."""
    rows: list[Row] = []
    name = session.names[0]
    sizes = SIZES if session.on_gpu and not session.quick else FEW_SIZES
    rays = ray_sets(session.mesh(name), session.core(name), sizes[-1])["random"]
    query = MeshQuery(session.mesh(name), session.device)
    for size in sizes:
        if session.seconds_left() < LEAST_SECONDS:
            break
        found = rows_of(session, name, (rays[0][:size], rays[1][:size]), query)
        rows += found
        print("small", size, {row["kernel"]: round(row["call_us"], 1) for row in found}, flush=True)
    return rows


def rows_of(session: Session, name: str, rays: Set, query: MeshQuery) -> list[Row]:
    """The kernels, by graph replays and by calls, then the scene's own calls."""
    scene = session.scene(name)
    origins, directions = session.upload(rays[0]), session.upload(rays[1])
    limits, outputs = session.limits(), session.outputs(len(rays[0]))
    launches: dict[str, Callable[[], object]] = {}
    for lanes, block in forms(session, SMALL_FORMS):

        def launch(lanes=lanes, block=block) -> None:  # type: ignore[no-untyped-def]
            launch_closest(scene.tree, origins, directions, *limits, *outputs, lanes=lanes, block_dim=block)

        launches[f"wive L{lanes} block {block}"] = launch
    launches["mesh_query_ray"] = lambda: query.launch(origins, directions, *outputs, block_dim=QUERY_BLOCK)
    calls: dict[str, Callable[[], object]] = {
        "intersect(warp)": lambda: scene.intersect(origins, directions),
        "intersect(numpy)": lambda: scene.intersect(*rays),
    }
    rows: list[Row] = []
    rounds = session.count(CALLS, FEW_CALLS)
    for kernel, work in (launches | calls).items():
        row: Row = {"rays": len(rays[0]), "kernel": kernel}
        if session.on_gpu and kernel in launches:
            row["device_us"] = graph_seconds(session, work) * 1e6
        rows.append({**row, "call_us": session.call_seconds(work, rounds) * 1e6})
    return rows


def graph_seconds(session: Session, launch: Callable[[], object]) -> float:
    """Seconds of one launch, many of them in one CUDA graph."""
    launch()  # compiled outside the capture
    with wp.ScopedCapture(device=session.device) as capture:
        for _ in range(IN_GRAPH):
            launch()
    return session.device_seconds(lambda: wp.capture_launch(capture.graph)) / IN_GRAPH
