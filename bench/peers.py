"""wive against tinybvh and madmann91/bvh, compiled from their sources: rays on one core, building on all.

    python -m bench peers --tinybvh FOLDER --bvh FOLDER

Each peer traces one ray at a time, in its fastest layout for AVX2, over the trees of both of its builders.
`watertight` and `fast`: its seconds over those of wive's batches in that accuracy; `one_ray`: over those of
wive's single rays in `fast`, whose triangle test is the nearest to theirs; all with wive's AVX2 kernels and
its usual tree, in turn on one pinned core. `build`: seconds of building on all cores, over wive's. Above 1
wive is faster. `mismatches`: rays that only one of the peer and `watertight` hits, per million; neither
peer is watertight.
"""

import argparse
import ctypes
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import BenchError
from bench.contenders.native_peers import LIBRARIES, PeerTree, peer_library
from bench.support import report
from bench.support.groups import mean_rows
from bench.support.options import listed, scene_parser
from bench.support.rays import KINDS, Rays, recorded_rays
from bench.support.scenes import Mesh, SceneFolder
from bench.support.timing import (
    QUICK,
    Effort,
    compare,
    compare_in_turn,
    one_core,
    timed,
    wall_timed,
)
from wive import _cpu

KERNEL = "avx2"  # what the peers are compiled for
RAYS, QUICK_RAYS = 65_536, 8_192  # of each kind and scene
EFFORT, BUILD_EFFORT = Effort(least=5, most=9), Effort(least=3, most=3)
# Name of the column: accuracy and rays in flight, 0 for as many as the core chooses.
WAYS = {"watertight": ("watertight", 0), "fast": ("fast", 0), "one_ray": ("fast", 1)}
KEYS = ["peer", "builder", "rays"]
COLUMNS = ["scene", "triangles", *KEYS, *WAYS, "peer_mrays", "mismatches"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    given = {name: getattr(chosen, name) for name in LIBRARIES}
    shims = {name: peer_library(name, folder) for name, folder in given.items() if folder is not None}
    if not shims:
        raise BenchError("expected --tinybvh FOLDER or --bvh FOLDER, with their sources")
    if reason := _cpu.kernels()[KERNEL]:
        raise BenchError(f"the peers are compiled for AVX2: {reason}")
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes)
    rows: list[report.Row] = []
    builds: list[report.Row] = []
    for name in scenes.names:
        mesh = folder.load(name)
        recorded = recorded_rays(mesh)
        sets = [recorded[kind].thinned(QUICK_RAYS if chosen.quick else RAYS) for kind in chosen.rays]
        for row in speed_rows(mesh, shims, sets, QUICK if chosen.quick else EFFORT):
            rows.append(row)
            report.print_progress(row, ("scene", *KEYS, *WAYS))
        builds += build_rows(mesh, shims, QUICK if chosen.quick else BUILD_EFFORT)
    means = mean_rows(rows, KEYS, list(WAYS))
    report.print_table(rows, COLUMNS, "One core: the peer's seconds over wive's")
    report.print_table(means, [*KEYS, *WAYS], "Geometric means over the scenes")
    report.print_table(builds, list(builds[0]), "Building on all cores: the peer's seconds over wive's")
    content = {"rows": rows, "means": means, "builds": builds}
    whole = scenes.whole and not chosen.quick and set(shims) == set(LIBRARIES) and chosen.rays == KINDS
    report.save("peers", content, chosen.out, whole=whole)


def speed_rows(
    mesh: Mesh, shims: dict[str, ctypes.CDLL], sets: Sequence[Rays], effort: Effort
) -> Iterator[report.Row]:
    """One row per peer, builder and set of rays."""
    trees = {accuracy: _cpu.Bvh(mesh.vertices, mesh.faces, accuracy) for accuracy in ("watertight", "fast")}

    def ours(rays: Rays, accuracy: str, in_flight: int) -> NDArray[np.bool_]:
        tree = trees[accuracy]
        if rays.any_hit:
            return tree.occluded(KERNEL, *rays.arrays, threads=1, in_flight=in_flight)[0]
        return tree.intersect(KERNEL, *rays.arrays, threads=1, in_flight=in_flight)[1] >= 0

    for name, shim in shims.items():
        for builder in ("usual", "high"):
            with PeerTree(shim, mesh, high=builder == "high") as peer:
                for rays in sets:
                    runs = [timed(lambda rays=rays, way=way: ours(rays, *way)) for way in WAYS.values()]  # type: ignore[misc]
                    differ = peer.trace(rays) != ours(rays, "watertight", 0)
                    with one_core():
                        outcomes = compare_in_turn(
                            [timed(lambda rays=rays: peer.trace(rays)), *runs],  # type: ignore[misc]
                            effort,
                        )
                    yield {
                        "scene": mesh.name,
                        "triangles": len(mesh.faces),
                        "peer": name,
                        "builder": builder,
                        "rays": rays.kind,
                        **{way: outcome.ratio for way, outcome in zip(WAYS, outcomes[1:], strict=True)},
                        "peer_mrays": len(rays) / outcomes[0].our_seconds * 1e-6,
                        "mismatches": float(np.mean(differ) * 1e6),
                    }


def build_rows(mesh: Mesh, shims: dict[str, ctypes.CDLL], effort: Effort) -> Iterator[report.Row]:
    """One row per peer: its two builders against wive's "medium" and "high"."""

    def build(shim: ctypes.CDLL, high: bool) -> None:
        with PeerTree(shim, mesh, high=high):
            pass

    for name, shim in shims.items():
        row: report.Row = {"scene": mesh.name, "triangles": len(mesh.faces), "peer": name}
        for builder, quality in (("usual", "medium"), ("high", "high")):
            ours = wall_timed(lambda quality=quality: _cpu.Bvh(mesh.vertices, mesh.faces, quality=quality))  # type: ignore[misc]
            theirs = wall_timed(lambda shim=shim, high=builder == "high": build(shim, high))  # type: ignore[misc]
            outcome = compare(ours, theirs, effort)
            row |= {builder: outcome.ratio, f"{builder}_seconds": outcome.their_seconds}
        yield row


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("peers", __doc__)
    for name in LIBRARIES:
        parser.add_argument(f"--{name}", type=Path, help=f"the folder of {name}'s sources")
    parser.add_argument("--rays", type=listed(KINDS), default=KINDS, help=", ".join(KINDS))
    return parser.parse_args(options)
