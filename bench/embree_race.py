"""wive and native Embree side by side on one mesh: rows of speed, of build time, and of the trees built."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bench.embree_statistics import embree_statistics
from bench.native_embree import EmbreeMesh, Isa, flushed_denormals, trim_heap
from bench.rays import Rays
from bench.report import Row
from bench.scenes import Mesh
from bench.timing import Comparison, Effort, compare, one_core, timed
from wive import _cpu

Accuracy = Literal["fast", "watertight"]


@dataclass(frozen=True)
class Contender:
    """One way of ours to trace, and the Embree that it is measured against."""

    kernel: str
    in_flight: int = 1

    @property
    def isa(self) -> Isa:
        """The instruction set that Embree is held to."""
        isas: dict[str, Isa] = {"avx512": "avx512", "avx2": "avx2", "scalar": "sse2"}
        return isas[self.kernel.split(".")[0]]


def embree_tree(mesh: Mesh, accuracy: Accuracy, isa: Isa, threads: int = 1) -> EmbreeMesh:
    """Embree's counterpart to an accuracy of ours, not yet built: robust for watertight."""
    return EmbreeMesh(mesh.vertices, mesh.faces, isa=isa, robust=accuracy == "watertight", threads=threads)


def speed_rows(
    mesh: Mesh,
    accuracy: Accuracy,
    contenders: Sequence[Contender],
    sets: Sequence[Rays],
    effort: Effort,
    flush_denormals: bool,
) -> Iterator[Row]:
    """One row per contender and set of rays, both sides on one pinned core."""
    ours = _cpu.Bvh(mesh.vertices, mesh.faces, accuracy)
    for isa in dict.fromkeys(contender.isa for contender in contenders):
        cases = list(product([one for one in contenders if one.isa == isa], sets))
        with embree_tree(mesh, accuracy, isa) as theirs:
            theirs.commit()
            for contender, rays in cases:
                with one_core(), flushed_denormals(flush_denormals):
                    comparison, mismatches = race(ours, theirs, contender, rays, effort)
                yield {
                    "scene": mesh.name,
                    "triangles": len(mesh.faces),
                    "accuracy": accuracy,
                    "kernel": contender.kernel,
                    "in_flight": contender.in_flight,
                    "isa": isa,
                    "rays": rays.kind,
                    "count": len(rays),
                    **_quartiles(comparison),
                    "wive_mrays": len(rays) / comparison.our_seconds * 1e-6,
                    "embree_mrays": len(rays) / comparison.their_seconds * 1e-6,
                    "mismatches": mismatches,
                }


def race(
    ours: _cpu.Bvh, theirs: EmbreeMesh, contender: Contender, rays: Rays, effort: Effort
) -> tuple[Comparison, int]:
    """Times both on one set of rays; also the number of rays that only one of them hits."""
    runs = (
        _any_hit(ours, theirs, contender, rays)
        if rays.any_hit
        else _closest_hit(ours, theirs, contender, rays)
    )
    our_run, their_run = runs
    mismatches = int(np.count_nonzero(our_run() != their_run()))  # this is the warm-up, too
    return compare(timed(our_run), timed(their_run), effort), mismatches


Run = Callable[[], NDArray[np.bool_]]


def _closest_hit(ours: _cpu.Bvh, theirs: EmbreeMesh, contender: Contender, rays: Rays) -> tuple[Run, Run]:
    def our_run() -> NDArray[np.bool_]:
        _, prim, _, _ = ours.intersect(
            contender.kernel, *rays.arrays, threads=1, in_flight=contender.in_flight
        )
        return prim >= 0

    def their_run() -> NDArray[np.bool_]:
        _, prim, _ = theirs.intersect(*rays.arrays)
        return prim >= 0

    return our_run, their_run


def _any_hit(ours: _cpu.Bvh, theirs: EmbreeMesh, contender: Contender, rays: Rays) -> tuple[Run, Run]:
    def our_run() -> NDArray[np.bool_]:
        return ours.occluded(contender.kernel, *rays.arrays, threads=1, in_flight=contender.in_flight)[0]

    def their_run() -> NDArray[np.bool_]:
        return theirs.occluded(*rays.arrays)

    return our_run, their_run


def build_rows(
    mesh: Mesh, accuracy: Accuracy, isa: Isa, thread_counts: Sequence[int], effort: Effort
) -> Iterator[Row]:
    """Building alone, per thread count: our constructor against rtcCommitScene at its default quality."""
    for threads in thread_counts:
        comparison = _compare_builds(mesh, accuracy, isa, threads, effort)
        yield {
            "scene": mesh.name,
            "triangles": len(mesh.faces),
            "accuracy": accuracy,
            "threads": threads,
            **_quartiles(comparison),
            "wive_seconds": comparison.our_seconds,
            "embree_seconds": comparison.their_seconds,
        }


def _compare_builds(mesh: Mesh, accuracy: Accuracy, isa: Isa, threads: int, effort: Effort) -> Comparison:
    def our_seconds() -> float:
        trim_heap()
        start = time.perf_counter()
        tree = _cpu.Bvh(mesh.vertices, mesh.faces, accuracy, threads=threads)
        seconds = time.perf_counter() - start
        del tree  # freeing is not building
        return seconds

    def their_seconds() -> float:
        with embree_tree(mesh, accuracy, isa, threads) as tree:
            trim_heap()
            return tree.commit()

    our_seconds()
    their_seconds()
    return compare(our_seconds, their_seconds, effort)


def tree_row(mesh: Mesh, accuracy: Accuracy, isa: Isa) -> Row:
    """SAH cost and bytes of both trees, ours over Embree's.

    The ratio of bytes is against what Embree uses; `embree_allocated` is what it holds for that.
    """
    ours = _cpu.Bvh(mesh.vertices, mesh.faces, accuracy)
    inner, leaves = ours.sah
    theirs = embree_statistics(mesh, isa=isa, robust=accuracy == "watertight")
    with embree_tree(mesh, accuracy, isa) as tree:
        tree.commit()
        allocated = tree.memory / len(mesh.faces)
    their_sah = theirs.sah_inner + theirs.sah_leaves
    our_bytes = ours.memory / len(mesh.faces)
    return {
        "scene": mesh.name,
        "triangles": len(mesh.faces),
        "accuracy": accuracy,
        "sah_ratio": (inner + leaves) / their_sah,
        "wive_sah": inner + leaves,
        "embree_sah": their_sah,
        "wive_sah_inner": inner,
        "embree_sah_inner": theirs.sah_inner,
        "bytes_ratio": our_bytes / theirs.bytes_per_triangle,
        "wive_bytes": our_bytes,
        "embree_bytes": theirs.bytes_per_triangle,
        "embree_allocated": allocated,
        "wive_nodes": len(ours.nodes),
        "embree_nodes": theirs.inner_nodes,
        "wive_depth": ours.depth,
        "embree_depth": theirs.depth,
        "intersector": theirs.intersector,
    }


def _quartiles(comparison: Comparison) -> Row:
    return {
        "ratio": comparison.ratio,
        "low": comparison.low,
        "high": comparison.high,
        "rounds": comparison.rounds,
    }
