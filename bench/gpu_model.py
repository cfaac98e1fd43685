"""What the warps of a GPU would do: wive's CUDA code against wp.mesh_query_ray's, counted without a GPU.

Each kernel's PTX runs on the host (bench/ptx) over the same rays, 32 lanes in step, and loads go through a
model of an L1 cache. Per ray: instructions that warps issue, lanes active in them, lines of 128 bytes that
loads of the tree and of local memory ask for, and sectors that are not in the cache. Ratios of counts tell
designs apart; they are not ratios of times.
"""

import argparse
import ctypes
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

import numpy as np

from bench.support import report
from bench.support.options import listed, numbers, scene_parser
from bench.support.rays import KINDS, Rays, recorded_rays
from bench.support.report import Row
from bench.support.scenes import Mesh, SceneFolder

SCENES = ("living_room", "terrain_jacksboro", "bathroom_salledebain")
NODES: tuple[Literal["float32", "compressed"], ...] = ("float32", "compressed")
RAYS, QUICK_RAYS = 4096, 1024
RUN = 256  # rays that are neighbours in the recorded sets
COLUMNS = [
    "scene", "rays", "kernel", "count", "instructions", "active", "lines", "local_lines", "sectors",
    "missed_sectors", "instructions_over_sah", "instructions_over_cubql", "lines_over_sah",
    "lines_over_cubql", "mismatches",
]  # fmt: skip


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes or SCENES)
    count = QUICK_RAYS if chosen.quick else RAYS
    rows: list[Row] = []
    for name in scenes.names:
        mesh = folder.load(name)
        recorded = recorded_rays(mesh)
        for kind in chosen.rays:
            found = list(rows_of(mesh, recorded[kind].thinned(count, RUN), chosen.lanes))
            add_ratios(found)
            rows += [{"scene": name, "rays": kind, **row} for row in found]
            report.print_table(rows[-len(found) :], COLUMNS)
    report.print_table(rows, COLUMNS, "Counts per ray; ratios above 1: wive needs less")
    whole = not chosen.quick and not chosen.scenes and not scenes.missing
    report.save("gpu_model", {"rows": rows}, chosen.out, whole=whole)


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("gpu_model", __doc__)
    parser.add_argument("--rays", type=listed(KINDS), default=("diffuse", "random"), help="kinds of rays")
    parser.add_argument("--lanes", type=numbers, default=(8, 1), help="lane forms, e.g. 8,1")
    return parser.parse_args(options)


def rows_of(mesh: Mesh, rays: Rays, lanes: Sequence[Literal[1, 8]]) -> Iterator[Row]:
    """One row per kernel over one set of rays."""
    import warp as wp

    import wive
    from bench.contenders.mesh_query_ray import BUILDERS, MeshQuery
    from wive.warp_kernels import launch_closest

    count = len(rays)
    origins, directions = (wp.array(rows, dtype=wp.vec3, device="cpu") for rows in rays.arrays[:2])
    limits = [wp.array(values, dtype=wp.float32, device="cpu") for values in rays.arrays[2:]]
    truth = wive.Scene(mesh.vertices, mesh.faces).intersect(*rays.arrays[:2]).prim
    outputs: tuple[Any, ...] = ()
    for builder in BUILDERS:
        query = MeshQuery(mesh, "cpu", builder)
        outputs = query.outputs(count)

        def query_rays(query: MeshQuery = query, outputs: tuple[Any, ...] = outputs) -> None:
            query.launch(origins, directions, *outputs)

        yield counted(f"mesh_query_ray {builder}", query_rays, outputs[1], truth)
    for nodes in NODES:
        tree = wive.Scene(mesh.vertices, mesh.faces, device="cpu", nodes=nodes).tree
        for form in lanes:

            def trace(tree: Any = tree, form: Literal[1, 8] = form) -> None:
                launch_closest(tree, origins, directions, *limits, *outputs, lanes=form)

            yield counted(f"wive {nodes} L={form}", trace, outputs[1], truth)


def counted(kernel: str, work: Callable[[], None], prims: Any, truth: Any) -> Row:
    """The counts of one launch per ray, and the number of rays with another triangle than the core's."""
    from bench.ptx.launching import on_the_host
    from bench.ptx.model import Counts, ModelKernel, model_kernel

    made: list[ModelKernel] = []

    def make(*kernel_and_block: Any) -> ModelKernel:
        made.append(model_kernel(*kernel_and_block))
        made[-1].counts = Counts()
        return made[-1]

    ctypes.memset(prims.ptr, 0x7F, prims.size * 4)
    with on_the_host(make):
        work()
    (counts,), count = (one.counts for one in made), len(truth)
    return {
        "kernel": kernel,
        "count": count,
        "instructions": counts.instructions / count,
        "active": counts.active_lanes,
        "lines": counts.lines / count,
        "local_lines": counts.local_lines / count,
        "sectors": counts.sectors / count,
        "missed_sectors": (counts.missed_sectors + counts.local_missed_sectors) / count,
        "mismatches": int(np.count_nonzero(prims.numpy() != truth)),
    }


def add_ratios(rows: Sequence[Row]) -> None:
    """Adds to wive's rows what each of Warp's trees needs over what wive needs."""
    from bench.contenders.mesh_query_ray import BUILDERS

    by_kernel = {row["kernel"]: row for row in rows}
    for row in rows:
        for builder in BUILDERS:
            theirs = by_kernel[f"mesh_query_ray {builder}"]
            lines, our_lines = (one["lines"] + one["local_lines"] for one in (theirs, row))
            row[f"instructions_over_{builder}"] = theirs["instructions"] / row["instructions"]
            row[f"lines_over_{builder}"] = lines / our_lines
