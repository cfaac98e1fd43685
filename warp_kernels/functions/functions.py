"""closest_hit, any_hit and count_hits for users' own kernels: one thread, one ray.

Each has one overload per handle type, so the type of a kernel's argument chooses accuracy and precision.
"""

from typing import Any

import warp as wp

from wive.warp_kernels.functions.normals import make_normal
from wive.warp_kernels.lanes.lanes import address_of, without_gradient
from wive.warp_kernels.lanes.layout import NO_PRIM
from wive.warp_kernels.lanes.precision import PRECISIONS, in_double
from wive.warp_kernels.queries.frame import make_load_frame
from wive.warp_kernels.queries.query_exact import query_of
from wive.warp_kernels.traversal.alone import make_traversal
from wive.warp_kernels.tree.handle import CORRUPTION, HANDLES, HITS, KINDS, REFUSAL, USERS_STACK


@wp.func
def refused(error: wp.array(dtype=wp.int32), kind: int, wanted: int):
    """Whether the tree can't be traversed here: it is of another kind, which is noted, or was overwritten."""
    if kind != wanted:
        error[REFUSAL] = 1
    return kind != wanted or error[CORRUPTION] != 0


def make_functions(
    accuracy: str,
    precision: str,
    closest_hit: wp.Function | None = None,
    any_hit: wp.Function | None = None,
    count_hits: wp.Function | None = None,
) -> tuple[wp.Function, wp.Function, wp.Function]:
    """The functions, with overloads for the handles of one more accuracy and precision.

    Warp looks up the function that an overload extends among the local variables here, so the arguments are
    the functions made before.
    """
    handle_type, hit_type = HANDLES[accuracy, precision], HITS[precision]
    wanted = KINDS.index((accuracy, precision))
    real, vec3 = PRECISIONS[precision].real, PRECISIONS[precision].vec3
    normal_of = make_normal(accuracy, precision)
    closest, any_, count = (query_of(name, accuracy, precision) for name in ("closest", "any", "count"))
    load_frame = make_load_frame(accuracy, precision)
    begin_closest, distance = closest.begin, closest.distance
    begin_any, begin_count = any_.begin, count.begin
    trace_closest, trace_any, trace_count = (
        make_traversal(name, accuracy, USERS_STACK, precision) for name in ("closest", "any", "count")
    )

    @wp.func
    def closest_hit(bvh: handle_type, origin: vec3, direction: vec3, tmin: real, tmax: real) -> hit_type:
        """The closest hit in the closed interval [tmin, tmax], t in multiples of the direction's length.

        t, u, v and prim are bit for bit what `wive.Scene.intersect` returns; the normal and the side that was
        hit are computed in double, and cost nothing if they are not used. It takes the handle of a watertight
        tree (`Bvh`), of a fast one (`FastBvh`) or of an exact one (`ExactBvh`); with those of float64 scenes
        (`Bvh64`, `FastBvh64`) rays are vec3d and float64, and the hit is a `Hit64`. It has no gradient:
        `differentiable_hit` has.
        """
        hit = hit_type()
        hit.t = real(wp.inf)
        hit.u = real(wp.nan)
        hit.v = real(wp.nan)
        hit.prim = NO_PRIM
        hit.normal = vec3(real(wp.nan))
        ray = load_frame(bvh.center, origin, direction, tmin, tmax)
        if ray.valid and not refused(bvh.error, bvh.kind, wanted):
            best = trace_closest(bvh, ray, begin_closest(ray)).found
            if best.prim != NO_PRIM:
                hit.t = distance(best, ray.unscale)
                hit.u = best.u
                hit.v = best.v
                hit.prim = best.prim
                normal = normal_of(address_of(bvh.units), best.place)
                unit = normal / wp.length(normal)
                hit.normal = vec3(real(unit[0]), real(unit[1]), real(unit[2]))
                hit.front = wp.dot(normal, in_double(direction)) < wp.float64(0.0)
        return hit

    @wp.func
    def any_hit(bvh: handle_type, origin: vec3, direction: vec3, tmin: real, tmax: real) -> bool:
        """Whether the ray hits anything within the closed interval [tmin, tmax], t as in `closest_hit`.

        It takes the same handles and has no gradient.
        """
        ray = load_frame(bvh.center, origin, direction, tmin, tmax)
        hit = bool(False)
        if ray.valid and not refused(bvh.error, bvh.kind, wanted):
            hit = trace_any(bvh, ray, begin_any(ray)).found.prim != NO_PRIM
        return hit

    @wp.func
    def count_hits(bvh: handle_type, origin: vec3, direction: vec3, tmin: real, tmax: real) -> int:
        """The number of hits within the closed interval [tmin, tmax], as `wive.Scene.count`.

        It takes the same handles as `closest_hit` and has no gradient.
        """
        ray = load_frame(bvh.center, origin, direction, tmin, tmax)
        hits = int(0)
        if ray.valid and not refused(bvh.error, bvh.kind, wanted):
            hits = trace_count(bvh, ray, begin_count(ray)).found.count
        return hits

    return closest_hit, any_hit, count_hits


_functions: Any = ()
for _kind in KINDS:
    _functions = make_functions(*_kind, *_functions)
# Which triangle is hit does not change smoothly with anything: no gradient passes through the traversal.
for _function in _functions:
    for _overload in _function.user_overloads.values():
        without_gradient(_overload)
closest_hit, any_hit, count_hits = _functions
