"""The Warp backend: the tree that the C++ core built, traversed by NVIDIA Warp kernels, on CPU or CUDA.

Launches over batches of rays, as `wive.Scene` uses them:

    tree = upload(bvh, device)                 # bvh: wive._cpu.Bvh, device: "cpu", "cuda:0", ...
    launch_closest(tree, origins, directions, tmin, tmax, t, prim, uv)
    launch_any(tree, origins, directions, tmin, tmax, occluded)
    launch_count(tree, origins, directions, tmin, tmax, counts)
    offsets = scan_counts(counts)              # then launch_all lists the hits
    check(tree)                                # waits; raises if a kernel met a corrupt tree

Functions for users' own kernels take `tree.handle`, whose type depends on the accuracy: `Bvh` for watertight
trees, `FastBvh` for fast ones, `ExactBvh` for exact ones; in float64 scenes `Bvh64` and `FastBvh64`.

    @wp.kernel
    def shade(bvh: Bvh, origins: wp.array[wp.vec3], directions: wp.array[wp.vec3], depth: wp.array[float]):
        i = wp.tid()
        hit = closest_hit(bvh, origins[i], directions[i], 0.0, wp.inf)
        depth[i] = hit.t

Hits are those of the C++ backends, bit for bit; on a miss t is infinity, prim -1 and u, v NaN.
"""

from typing import TYPE_CHECKING, Any

from wive._internal.devices import warp_problem

if _problem := warp_problem():
    raise ImportError(f"wive.warp_kernels needs Warp: {_problem}")

from wive.warp_kernels.launching.closest_points import launch_closest_points
from wive.warp_kernels.launching.launch import (
    MOST_HITS,
    launch_all,
    launch_any,
    launch_closest,
    launch_count,
    scan_counts,
)
from wive.warp_kernels.tree.handle import Bvh, Bvh64, ClosestPoint, ExactBvh, FastBvh, FastBvh64, Hit, Hit64
from wive.warp_kernels.tree.tree import CorruptTreeError, Tree, check, upload

if TYPE_CHECKING:
    from wive.warp_kernels.functions.closest_point import closest_point
    from wive.warp_kernels.functions.functions import any_hit, closest_hit, count_hits
    from wive.warp_kernels.functions.gradients import SurfaceHit, SurfaceHit64, differentiable_hit

__all__ = [
    "MOST_HITS",
    "Bvh",
    "Bvh64",
    "ClosestPoint",
    "CorruptTreeError",
    "ExactBvh",
    "FastBvh",
    "FastBvh64",
    "Hit",
    "Hit64",
    "SurfaceHit",
    "SurfaceHit64",
    "Tree",
    "any_hit",
    "check",
    "closest_hit",
    "closest_point",
    "count_hits",
    "differentiable_hit",
    "launch_all",
    "launch_any",
    "launch_closest",
    "launch_closest_points",
    "launch_count",
    "scan_counts",
    "upload",
]

# The functions for users' kernels are made when first used: they take a tenth of a second or more.
_FUNCTIONS = {"any_hit", "closest_hit", "count_hits"}
_POINTS = {"closest_point"}
_GRADIENTS = {"SurfaceHit", "SurfaceHit64", "differentiable_hit"}


def __getattr__(name: str) -> Any:
    if name in _FUNCTIONS:
        from wive.warp_kernels.functions import functions as made_by
    elif name in _POINTS:
        from wive.warp_kernels.functions import closest_point as made_by
    elif name in _GRADIENTS:
        from wive.warp_kernels.functions import gradients as made_by
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return globals().setdefault(name, getattr(made_by, name))


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
