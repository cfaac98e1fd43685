"""wive's Warp kernels against `wp.mesh_query_ray` on the same rays, launched in turn on one device."""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Literal

import numpy as np
import warp as wp

import wive
from bench.contenders.mesh_query_ray import BUILDERS, MeshQuery
from bench.support.groups import grouped
from bench.support.rays import Rays
from bench.support.report import Row
from bench.support.scenes import Mesh
from bench.support.timing import Effort, compare, geometric_mean, one_core, timed
from wive.warp_kernels import launch_closest

Accuracy = Literal["fast", "watertight"]
ACCURACIES: tuple[Accuracy, ...] = ("fast", "watertight")


def compare_rows(
    mesh: Mesh, device: str, lanes: Sequence[Literal[1, 8]], sets: Sequence[Rays], effort: Effort
) -> Iterator[Row]:
    """One row per accuracy, lane form, set of rays and tree of Warp's."""
    queries = [MeshQuery(mesh, device, builder) for builder in BUILDERS]
    for accuracy in ACCURACIES:
        scene = wive.Scene(mesh.vertices, mesh.faces, device=device, accuracy=accuracy)
        for form in lanes:
            for rays in sets:
                for theirs in queries:
                    yield _row(mesh, scene, theirs, form, rays, effort)


def mean_rows(rows: Sequence[Row]) -> list[Row]:
    """Geometric mean and lowest ratio over scenes, per kind of rays, accuracy, lane form and builder."""
    means = []
    for key, group in grouped(rows, ("rays", "accuracy", "lanes", "builder")):
        ratios = [row["ratio"] for row in group]
        means.append({**key, "mean": geometric_mean(ratios), "lowest": min(ratios)})
    return means


def _row(
    mesh: Mesh, scene: wive.Scene, theirs: MeshQuery, lanes: Literal[1, 8], rays: Rays, effort: Effort
) -> Row:
    device, count = theirs.device, len(rays)
    origins, directions, tmin, tmax = (
        wp.array(array, dtype=wp.vec3 if array.ndim == 2 else wp.float32, device=device)
        for array in rays.arrays
    )
    our_hits, their_hits = theirs.outputs(count), theirs.outputs(count)
    timer = timed if device == "cpu" else _timed_on_cuda(device)
    ours = timer(lambda: launch_closest(scene.tree, origins, directions, tmin, tmax, *our_hits, lanes=lanes))
    them = timer(lambda: theirs.launch(origins, directions, *their_hits))
    with one_core():
        ours()
        them()
        outcome = compare(ours, them, effort)
    only_one = (our_hits[1].numpy() >= 0) != (their_hits[1].numpy() >= 0)
    return {
        "scene": mesh.name,
        "triangles": len(mesh.faces),
        "rays": rays.kind,
        "accuracy": scene.accuracy,
        "lanes": lanes,
        "builder": theirs.builder,
        "device": device,
        "count": count,
        "ratio": outcome.ratio,
        "low": outcome.low,
        "high": outcome.high,
        "wive_mrays": count / outcome.our_seconds / 1e6,
        "mesh_query_ray_mrays": count / outcome.their_seconds / 1e6,
        "rounds": outcome.rounds,
        "mismatches": int(np.count_nonzero(only_one)),
    }


def _timed_on_cuda(device: str) -> Callable[[Callable[[], object]], Callable[[], float]]:
    """Wall-clock seconds of a launch, from an idle device to an idle device."""

    def timer(work: Callable[[], object]) -> Callable[[], float]:
        def run() -> float:
            wp.synchronize_device(device)
            start = time.perf_counter()
            work()
            wp.synchronize_device(device)
            return time.perf_counter() - start

        return run

    return timer
