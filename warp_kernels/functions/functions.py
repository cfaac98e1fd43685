"""closest_hit, any_hit and count_hits for users' own kernels: one thread, one ray.

Each has one overload per handle type, so the type of a kernel's argument chooses the accuracy.
"""

from typing import Any

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.lanes.layout import NO_PRIM
from wive.warp_kernels.queries.frame import make_load_frame
from wive.warp_kernels.queries.query_exact import query_of
from wive.warp_kernels.traversal.traversal import make_traversal
from wive.warp_kernels.tree.handle import ACCURACIES, HANDLES, STACK_TOO_SMALL, WRONG_ACCURACY, Hit

# A tree of 2.7 million triangles needs less than 100; deeper trees are refused by the error flag.
STACK_SIZE = 128


@wp.func
def _refused(error: wp.array(dtype=wp.int32), stack: int, accuracy: int, wanted: int, refusal: int):
    """Whether the tree can't be traversed here; the error flag then says why."""
    reason = int(0)
    if stack > STACK_SIZE:
        reason = STACK_TOO_SMALL
    if accuracy != wanted:
        reason = WRONG_ACCURACY
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
    hit.prim = NO_PRIM
    return hit


def make_functions(
    accuracy: str,
    closest_hit: wp.Function | None = None,
    any_hit: wp.Function | None = None,
    count_hits: wp.Function | None = None,
) -> tuple[wp.Function, wp.Function, wp.Function]:
    """The functions, with overloads for the handles of one more accuracy.

    Warp looks up the function that an overload extends among the local variables here, so the arguments are
    the functions made before.
    """
    handle_type, wanted = HANDLES[accuracy], ACCURACIES.index(accuracy)
    closest, any_, count = (query_of(name, accuracy) for name in ("closest", "any", "count"))
    load_frame = make_load_frame(accuracy, "float32")
    begin_closest, distance = closest.begin, closest.distance
    begin_any, begin_count = any_.begin, count.begin
    trace_closest, trace_any, trace_count = (
        make_traversal(name, accuracy, 8, STACK_SIZE, False) for name in ("closest", "any", "count")
    )

    @wp.func
    def closest_hit(bvh: handle_type, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> Hit:
        """The closest hit in the closed interval [tmin, tmax], t in multiples of the direction's length.

        Bit for bit what `wive.Scene.intersect` returns. It takes the handle of a watertight tree (`Bvh`), of
        a fast one (`FastBvh`) or of an exact one (`ExactBvh`). It has no gradient: `differentiable_hit` has.
        """
        hit = _miss()
        ray = load_frame(bvh.center, origin, direction, tmin, tmax)
        if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wanted, bvh.refusal):
            best = trace_closest(bvh, ray, 0, begin_closest(ray)).found
            if best.prim != NO_PRIM:
                hit.t = distance(best, ray.unscale)
                hit.u = best.u
                hit.v = best.v
                hit.prim = best.prim
        return hit

    @wp.func
    def any_hit(bvh: handle_type, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> bool:
        """Whether the ray hits anything within the closed interval [tmin, tmax], t as in `closest_hit`.

        It takes the same handles and has no gradient.
        """
        ray = load_frame(bvh.center, origin, direction, tmin, tmax)
        hit = bool(False)
        if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wanted, bvh.refusal):
            hit = trace_any(bvh, ray, 0, begin_any(ray)).found.prim != NO_PRIM
        return hit

    @wp.func
    def count_hits(bvh: handle_type, origin: wp.vec3, direction: wp.vec3, tmin: float, tmax: float) -> int:
        """The number of hits within the closed interval [tmin, tmax], as `wive.Scene.count`.

        It takes the same handles as `closest_hit` and has no gradient.
        """
        ray = load_frame(bvh.center, origin, direction, tmin, tmax)
        hits = int(0)
        if ray.valid and not _refused(bvh.error, bvh.stack, bvh.accuracy, wanted, bvh.refusal):
            hits = trace_count(bvh, ray, 0, begin_count(ray)).found.count
        return hits

    return closest_hit, any_hit, count_hits


_functions: Any = ()
for _accuracy in ACCURACIES:
    _functions = make_functions(_accuracy, *_functions)
# Which triangle is hit does not change smoothly with anything: no gradient passes through the traversal.
for _function in _functions:
    for _overload in _function.user_overloads.values():
        without_gradient(_overload)
closest_hit, any_hit, count_hits = _functions
