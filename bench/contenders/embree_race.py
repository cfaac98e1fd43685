"""wive and native Embree side by side on one mesh: rows of speed."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from bench.contenders.native_embree import EmbreeMesh, Isa, Quality, Width, flushed_denormals
from bench.support.options import Accuracy, Nodes
from bench.support.rays import Rays
from bench.support.report import Row
from bench.support.scenes import Mesh
from bench.support.timing import Comparison, Effort, compare, one_core, timed
from wive import _cpu

PACKET_WIDTHS: tuple[Width, ...] = (1, 8, 16)  # of Embree
TUNED = 0  # in flight: as many rays as the core chooses


@dataclass(frozen=True)
class Contender:
    """One way to trace with wive, and the instruction set that Embree is held to against it."""

    kernel: str
    in_flight: int = 1
    nodes: Nodes = "float32"

    @property
    def isa(self) -> Isa:
        """The instruction set that Embree is held to."""
        isas: dict[str, Isa] = {"avx512": "avx512", "avx2": "avx2", "scalar": "sse2"}
        return isas[self.kernel.split(".")[0]]


def embree_tree(
    mesh: Mesh, accuracy: Accuracy, isa: Isa, threads: int = 1, quality: Quality = "medium"
) -> EmbreeMesh:
    """Embree's counterpart to one of wive's accuracies, not yet built: robust for watertight."""
    robust = accuracy == "watertight"
    return EmbreeMesh(mesh.vertices, mesh.faces, isa=isa, robust=robust, threads=threads, quality=quality)


def speed_rows(
    mesh: Mesh,
    accuracy: Accuracy,
    contenders: Sequence[Contender],
    sets: Sequence[Rays],
    effort: Effort,
    flush_denormals: bool,
) -> Iterator[Row]:
    """One row per contender and set of rays, both sides on one pinned core."""
    forms = dict.fromkeys(contender.nodes for contender in contenders)
    ours = {nodes: _cpu.Bvh(mesh.vertices, mesh.faces, accuracy, nodes=nodes) for nodes in forms}
    for isa in dict.fromkeys(contender.isa for contender in contenders):
        cases = list(product([one for one in contenders if one.isa == isa], sets))
        with embree_tree(mesh, accuracy, isa) as theirs:
            theirs.commit()
            for contender, rays in cases:
                with one_core(), flushed_denormals(flush_denormals):
                    comparison, mismatches = race(ours[contender.nodes], theirs, contender, rays, effort)
                yield {
                    "scene": mesh.name,
                    "triangles": len(mesh.faces),
                    "accuracy": accuracy,
                    "kernel": contender.kernel,
                    "in_flight": contender.in_flight or "tuned",
                    "nodes": contender.nodes,
                    "isa": isa,
                    "rays": rays.kind,
                    "count": len(rays),
                    **quartiles(comparison),
                    "wive_mrays": len(rays) / comparison.our_seconds * 1e-6,
                    "embree_mrays": len(rays) / comparison.their_seconds * 1e-6,
                    "mismatches": mismatches,
                }


def packet_rows(
    mesh: Mesh, accuracy: Accuracy, kernel: str, rays: Rays, effort: Effort, flush_denormals: bool
) -> Iterator[Row]:
    """One row per width of Embree's packets, wive with its default rays in flight: closest hits."""
    contender = Contender(kernel, TUNED)
    ours = _cpu.Bvh(mesh.vertices, mesh.faces, accuracy)
    with embree_tree(mesh, accuracy, contender.isa) as theirs:
        theirs.commit()
        for width in PACKET_WIDTHS:
            with one_core(), flushed_denormals(flush_denormals):
                comparison, mismatches = race(ours, theirs, contender, rays, effort, width)
            yield {
                "scene": mesh.name,
                "triangles": len(mesh.faces),
                "accuracy": accuracy,
                "kernel": kernel,
                "isa": contender.isa,
                "rays": rays.kind,
                "count": len(rays),
                "width": width,
                **quartiles(comparison),
                "wive_mrays": len(rays) / comparison.our_seconds * 1e-6,
                "embree_mrays": len(rays) / comparison.their_seconds * 1e-6,
                "mismatches": mismatches,
            }


def race(
    ours: _cpu.Bvh, theirs: EmbreeMesh, contender: Contender, rays: Rays, effort: Effort, width: Width = 1
) -> tuple[Comparison, int]:
    """The times of both sides on one set of rays, and the number of rays that only one side hits.

    `width`: rays per call of Embree, for closest hits.
    """
    runs = (
        _any_hit(ours, theirs, contender, rays)
        if rays.any_hit
        else _closest_hit(ours, theirs, contender, rays, width)
    )
    our_run, their_run = runs
    mismatches = int(np.count_nonzero(our_run() != their_run()))  # warms up
    return compare(timed(our_run), timed(their_run), effort), mismatches


Run = Callable[[], NDArray[np.bool_]]


def _closest_hit(
    ours: _cpu.Bvh, theirs: EmbreeMesh, contender: Contender, rays: Rays, width: Width
) -> tuple[Run, Run]:
    def our_run() -> NDArray[np.bool_]:
        _, prim, _, _ = ours.intersect(
            contender.kernel, *rays.arrays, threads=1, in_flight=contender.in_flight
        )
        return prim >= 0

    def their_run() -> NDArray[np.bool_]:
        _, prim, _ = theirs.intersect(*rays.arrays, width)
        return prim >= 0

    return our_run, their_run


def _any_hit(ours: _cpu.Bvh, theirs: EmbreeMesh, contender: Contender, rays: Rays) -> tuple[Run, Run]:
    def our_run() -> NDArray[np.bool_]:
        return ours.occluded(contender.kernel, *rays.arrays, threads=1, in_flight=contender.in_flight)[0]

    def their_run() -> NDArray[np.bool_]:
        return theirs.occluded(*rays.arrays)

    return our_run, their_run


def quartiles(comparison: Comparison) -> Row:
    """The columns of a comparison."""
    return {
        "ratio": comparison.ratio,
        "low": comparison.low,
        "high": comparison.high,
        "rounds": comparison.rounds,
    }
