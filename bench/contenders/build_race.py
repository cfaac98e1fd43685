"""wive and native Embree side by side on one mesh: rows of build time and of the trees built."""

import time
from collections.abc import Iterator, Sequence

from bench.contenders.embree_race import embree_tree, quartiles
from bench.contenders.embree_statistics import embree_statistics
from bench.contenders.native_embree import Isa, trim_heap
from bench.support.options import Accuracy, Quality
from bench.support.report import Row
from bench.support.scenes import Mesh
from bench.support.timing import Comparison, Effort, compare, core_count
from wive import _cpu

WARMED_UP = 4_000_000  # triangles; a longer build needs no other to warm up


def build_rows(
    mesh: Mesh,
    accuracy: Accuracy,
    isa: Isa,
    thread_counts: Sequence[int],
    effort: Effort,
    quality: Quality = "medium",
) -> Iterator[Row]:
    """Build times, one row per thread count: wive's constructor against rtcCommitScene, at one quality."""
    for threads in thread_counts:
        comparison = _compare_builds(mesh, accuracy, isa, threads, effort, quality)
        yield {
            "scene": mesh.name,
            "triangles": len(mesh.faces),
            "accuracy": accuracy,
            "quality": quality,
            "threads": threads,
            **quartiles(comparison),
            "wive_seconds": comparison.our_seconds,
            "embree_seconds": comparison.their_seconds,
        }


def _compare_builds(
    mesh: Mesh, accuracy: Accuracy, isa: Isa, threads: int, effort: Effort, quality: Quality
) -> Comparison:
    def our_seconds() -> float:
        trim_heap()
        start = time.perf_counter()
        tree = _cpu.Bvh(mesh.vertices, mesh.faces, accuracy, quality=quality, threads=threads)
        seconds = time.perf_counter() - start
        del tree  # after the clock has stopped
        return seconds

    def their_seconds() -> float:
        with embree_tree(mesh, accuracy, isa, threads, quality) as tree:
            trim_heap()
            return tree.commit()

    if len(mesh.faces) < WARMED_UP:
        our_seconds()
        their_seconds()
    return compare(our_seconds, their_seconds, effort)


def tree_row(mesh: Mesh, accuracy: Accuracy, isa: Isa, quality: Quality = "medium") -> Row:
    """SAH cost and bytes of both trees, wive's over Embree's.

    The ratio of bytes is over those that Embree's tree uses; `embree_allocated` are those that it allocates.
    """
    ours = _cpu.Bvh(mesh.vertices, mesh.faces, accuracy, quality=quality)
    inner, leaves = ours.sah
    theirs = embree_statistics(mesh, isa=isa, robust=accuracy == "watertight", quality=quality)
    with embree_tree(mesh, accuracy, isa, core_count(), quality) as tree:
        tree.commit()
        allocated = tree.memory / len(mesh.faces)
    their_sah = theirs.sah_inner + theirs.sah_leaves
    our_bytes = ours.memory / len(mesh.faces)
    return {
        "scene": mesh.name,
        "triangles": len(mesh.faces),
        "accuracy": accuracy,
        "quality": quality,
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
