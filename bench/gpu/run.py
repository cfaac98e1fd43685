"""wive's Warp kernels on one device, in sections, each saved as it ends: `python -m bench gpu`.

    about     the machine and the versions
    compile   every kernel that the sections below launch, compiled in parallel into Warp's cache
    right     hits of every kernel against the C++ core, bit for bit
    basics    cycles of the warp collectives and loads that a traversal is made of
    fast      Mray/s against wp.mesh_query_ray
    small     microseconds by batch size, on the device alone and seen from Python
    streams   arrays and streams of torch, CuPy and JAX, and CUDA graphs
    shadow    any hit, Mray/s against wp.mesh_query_ray_anyhit

`--device cpu` runs what a CPU can, with few rays: it shows that the bench works, no result. `--budget` is in
seconds; a section that would begin after it, or close to it, is left out.
"""

import argparse
import importlib
import time
import traceback
from collections.abc import Sequence

import warp as wp

from bench.gpu.session import SCENES, Session
from bench.support import report
from bench.support.options import listed, scene_parser
from bench.support.scenes import SceneFolder

SECTIONS = ("about", "compile", "right", "basics", "fast", "small", "streams", "shadow")
LEAST_SECONDS = 20.0  # left of the budget when a section may still begin


def main(options: Sequence[str]) -> None:
    """Runs the sections selected."""
    chosen = parse_options(options)
    wp.config.log_level = wp.LOG_WARNING
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, SCENES)
    session = Session(chosen.device, folder, scenes.names, chosen.budget, chosen.quick, chosen.workers)
    name = f"gpu-{session.short_name}"
    content: report.Row = {"bench": name, "environment": report.environment()}
    path = (chosen.out or report.partial_folder()) / f"{name}.json"
    failed = False
    for section in (section for section in SECTIONS if section in chosen.only):
        if session.seconds_left() < LEAST_SECONDS:
            content[section] = {"left out": "no time left"}
            failed = True
            continue
        start = time.perf_counter()
        try:
            content[section] = importlib.import_module(f"bench.gpu.{section}").run(session)
        except Exception:
            content[section] = {"failed": traceback.format_exc().splitlines()}
            failed = True
            print(traceback.format_exc(), flush=True)
        seconds = time.perf_counter() - start
        print(f"== {section}: {seconds:.1f} s, {session.seconds_left():.0f} s left", flush=True)
        report.write(path, content)
    whole = scenes.whole and session.on_gpu and not failed and not chosen.quick
    if whole and chosen.out is None and set(chosen.only) == set(SECTIONS):
        path = report.RESULTS / path.name
        report.write(path, content)
    print(f"\nwrote {path}")


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("gpu", __doc__)
    parser.add_argument("--device", default="cuda:0", help="Warp device")
    parser.add_argument("--budget", type=float, default=480.0, help="seconds for all sections")
    parser.add_argument("--only", type=listed(SECTIONS), default=SECTIONS, help=", ".join(SECTIONS))
    parser.add_argument("--workers", type=int, default=8, help="processes that compile")
    return parser.parse_args(options)
