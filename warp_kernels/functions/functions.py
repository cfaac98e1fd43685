"""Functions for users' own kernels: one thread, one ray.

Each has three forms, for the three handle types, so that an accuracy is chosen by what a kernel's argument is
called.
"""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

import warp as wp

from wive.warp_kernels.queries.frame import load_frame
from wive.warp_kernels.queries.query_exact import distance_of
from wive.warp_kernels.traversal.traversal import make_traversal
from wive.warp_kernels.tree.handle import (
    ACCURACIES,
    NO_PRIM,
    STACK_TOO_SMALL,
    WRONG_ACCURACY,
    Bvh,
    ExactBvh,
    FastBvh,
    Hit,
)

# A tree of 2.7 million triangles asks for less than 100 entries; deeper ones are refused by the error flag.
STACK = 128
FAST, WATERTIGHT, EXACT = range(len(ACCURACIES))

_closest_watertight = make_traversal("closest", "watertight", 8, STACK, False)
_closest_fast = make_traversal("closest", "fast", 8, STACK, False)
_closest_exact = make_traversal("closest", "exact", 8, STACK, False)
_any_watertight = make_traversal("any", "watertight", 8, STACK, False)
_any_fast = make_traversal("any", "fast", 8, STACK, False)
_any_exact = make_traversal("any", "exact", 8, STACK, False)
_count_watertight = make_traversal("count", "watertight", 8, STACK, False)
_count_fast = make_traversal("count", "fast", 8, STACK, False)
_count_exact = make_traversal("count", "exact", 8, STACK, False)


@wp.func
def _refused(error: wp.array(dtype=wp.int32), stack: int, accuracy: int, wanted: int, refusal: int):
    """Whether the tree can't be traversed here; says why in the error flag."""
    reason = int(0)  # noqa: RUF046, UP018
    if stack > STACK:
        reason = wp.static(STACK_TOO_SMALL)
    if accuracy != wanted:
        reason = wp.static(WRONG_ACCURACY)
    if refusal != 0:
        reason = refusal
    if reason != 0:
        error[0] = reason
    return reason != 0 or error[0] != 0


@wp.func
def _miss():
    hit = Hit()
    hit.t = wp.inf
    hit.u = wp.nan
    hit.v = wp.nan
    hit.prim = wp.static(NO_PRIM)
    return hit


@wp.func
def closest_hit(bvh: Bvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> Hit:
    """The closest hit within the closed interval [tmin, tmax], t in multiples of the direction's length.

    Bit for bit what `wive.Scene.intersect` returns. It takes the handle of a watertight tree (`Bvh`), of a
    fast one (`FastBvh`) or of an exact one (`ExactBvh`). Gradients stop here: `differentiable_hit` has them.
    """
    hit = _miss()
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(WATERTIGHT), bvh.refusal):
        best = _closest_watertight(bvh, ray, 0).best
        if best.prim != wp.static(NO_PRIM):
            hit.t = distance_of(best, ray.scale)
            hit.u = best.u
            hit.v = best.v
            hit.prim = best.prim
    return hit


@wp.func
def closest_hit(bvh: FastBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> Hit:  # noqa: F811
    """The closest hit in a fast tree."""
    hit = _miss()
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(FAST), bvh.refusal):
        best = _closest_fast(bvh, ray, 0).best
        if best.prim != wp.static(NO_PRIM):
            hit.t = distance_of(best, ray.scale)
            hit.u = best.u
            hit.v = best.v
            hit.prim = best.prim
    return hit


@wp.func
def closest_hit(bvh: ExactBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> Hit:  # noqa: F811
    """The closest hit in an exact tree."""
    hit = _miss()
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(EXACT), bvh.refusal):
        best = _closest_exact(bvh, ray, 0).best
        if best.prim != wp.static(NO_PRIM):
            hit.t = distance_of(best, ray.scale)
            hit.u = best.u
            hit.v = best.v
            hit.prim = best.prim
    return hit


@wp.func
def any_hit(bvh: Bvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> bool:
    """Whether anything lies within the closed interval [tmin, tmax], t as in `closest_hit`.

    It takes the handle of a watertight tree (`Bvh`), a fast one (`FastBvh`) or an exact one (`ExactBvh`).
    It has no gradients.
    """
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    hit = bool(False)  # noqa: UP018
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(WATERTIGHT), bvh.refusal):
        hit = _any_watertight(bvh, ray, 0).best.prim != wp.static(NO_PRIM)
    return hit


@wp.func
def any_hit(bvh: FastBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> bool:  # noqa: F811
    """Whether anything lies in the way in a fast tree."""
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    hit = bool(False)  # noqa: UP018
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(FAST), bvh.refusal):
        hit = _any_fast(bvh, ray, 0).best.prim != wp.static(NO_PRIM)
    return hit


@wp.func
def any_hit(bvh: ExactBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> bool:  # noqa: F811
    """Whether anything lies in the way in an exact tree."""
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    hit = bool(False)  # noqa: UP018
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(EXACT), bvh.refusal):
        hit = _any_exact(bvh, ray, 0).best.prim != wp.static(NO_PRIM)
    return hit


@wp.func
def count_hits(bvh: Bvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> int:
    """How many triangles the ray meets within the closed interval [tmin, tmax], as `wive.Scene.count`.

    It takes the handle of a watertight tree (`Bvh`), a fast one (`FastBvh`) or an exact one (`ExactBvh`).
    It has no gradients.
    """
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    count = int(0)  # noqa: RUF046, UP018
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(WATERTIGHT), bvh.refusal):
        count = _count_watertight(bvh, ray, 0).best.count
    return count


@wp.func
def count_hits(bvh: FastBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> int:  # noqa: F811
    """How many triangles the ray meets in a fast tree."""
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    count = int(0)  # noqa: RUF046, UP018
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(FAST), bvh.refusal):
        count = _count_fast(bvh, ray, 0).best.count
    return count


@wp.func
def count_hits(bvh: ExactBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> int:  # noqa: F811
    """How many triangles the ray meets in an exact tree."""
    ray = load_frame(bvh.center, bvh.extent, origin, direction, tmin, tmax)
    count = int(0)  # noqa: RUF046, UP018
    if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wp.static(EXACT), bvh.refusal):
        count = _count_exact(bvh, ray, 0).best.count
    return count


# Which triangle is hit does not change smoothly with anything: no gradient passes through the traversal.


@wp.func_grad(closest_hit)
def _no_gradient_of_closest(
    bvh: Bvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: Hit
):
    pass


@wp.func_grad(closest_hit)
def _no_gradient_of_closest_fast(
    bvh: FastBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: Hit
):
    pass


@wp.func_grad(closest_hit)
def _no_gradient_of_closest_exact(
    bvh: ExactBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: Hit
):
    pass


@wp.func_grad(any_hit)
def _no_gradient_of_any(
    bvh: Bvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: bool
):
    pass


@wp.func_grad(any_hit)
def _no_gradient_of_any_fast(
    bvh: FastBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: bool
):
    pass


@wp.func_grad(any_hit)
def _no_gradient_of_any_exact(
    bvh: ExactBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: bool
):
    pass


@wp.func_grad(count_hits)
def _no_gradient_of_count(
    bvh: Bvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: int
):
    pass


@wp.func_grad(count_hits)
def _no_gradient_of_count_fast(
    bvh: FastBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: int
):
    pass


@wp.func_grad(count_hits)
def _no_gradient_of_count_exact(
    bvh: ExactBvh, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float, adj_ret: int
):
    pass
