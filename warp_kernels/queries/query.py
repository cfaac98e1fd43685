"""The queries: what each keeps of the hits it is offered, as cpu/traverse/query.h and query_all.h."""

from dataclasses import dataclass
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.layout import NO_PRIM
from wive.warp_kernels.lanes.native import LIST_HIT
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.frame import FRAMES
from wive.warp_kernels.tree.handle import derive_struct


@dataclass(frozen=True)
class Query:
    """A query in trees of one precision.

    state: struct of what one thread has found.
    begin: the state of a ray for which nothing has been found.
    offer: the state after a hit, taken if it lies within the limits.
    limit: the largest t of hits that are still taken; None if it is not in the frame's units.
    distance: t in the caller's units, for the closest hit.
    in_order: children are visited from front to back and stored with their distances, because tmax falls with
        every hit.
    first_hit_ends: a hit of any thread ends the query.
    crossings: a ray through an edge or a vertex of a closed surface hits it as often as a ray beside it;
        otherwise triangles are closed.
    """

    state: Any
    begin: wp.Function
    offer: wp.Function
    limit: wp.Function | None = None
    distance: wp.Function | None = None
    in_order: bool = False
    first_hit_ends: bool = False
    crossings: bool = False


@wp.struct
class Best:
    """The best hit so far, in the frame's units: t falls with every hit found."""

    t: wp.float32
    u: wp.float32
    v: wp.float32
    prim: wp.int32
    place: wp.int32  # of its triangle in the tree, in the closest hit: its block plus its number there


@wp.struct
class MultiHit:
    """The number of triangles that one thread has hit, and the list that hits are added to."""

    tmax: wp.float32  # in the frame's units
    count: wp.int32
    unscale: wp.float32  # as `RayFrame` has it
    hits: wp.uint64  # address of the ray's first `ListedHit`
    remaining: wp.uint64  # address of the number of hits still to be listed


Best64 = derive_struct(Best, "Best64", "`Best` in a float64 tree.", t=wp.float64, u=wp.float64, v=wp.float64)
MultiHit64 = derive_struct(
    MultiHit, "MultiHit64", "`MultiHit` in a float64 tree.", tmax=wp.float64, unscale=wp.float64
)


@wp.func_native(LIST_HIT.replace("REAL", "float"))
def list_hit(hits: wp.uint64, remaining: wp.uint64, t: float, u: float, v: float, prim: int):
    """Write a hit to the last place still free; all threads of the ray may."""
    ...


@wp.func_native(LIST_HIT.replace("REAL", "double"))
def list_hit(
    hits: wp.uint64, remaining: wp.uint64, t: wp.float64, u: wp.float64, v: wp.float64, prim: int
): ...


def make_queries(precision: str, best_type: Any, multi_hit_type: Any) -> dict[str, Query]:
    """The queries by name, for trees of this precision."""
    real, vec3, frame_type = PRECISIONS[precision].real, PRECISIONS[precision].vec3, FRAMES[precision]

    @wp.func
    def begin_best(ray: frame_type):
        best = best_type()
        best.t = ray.tmax
        best.prim = NO_PRIM
        return best

    @wp.func
    def begin_multi_hit(ray: frame_type):
        found = multi_hit_type()
        found.tmax = ray.tmax
        return found

    @wp.func
    def limit_of_best(best: best_type):
        return best.t

    @wp.func
    def limit_of_all(found: multi_hit_type):
        return found.tmax

    @wp.func
    def distance(best: best_type, unscale: real):
        return best.t / unscale

    @wp.func
    def offer_closest(best: best_type, tmin: real, hit: vec3, prim: int):
        """The nearest hit in [tmin, t]; of hits at the same t the lowest prim, in any order of offers."""
        t = hit[0]
        if t >= tmin and (t < best.t or (t == best.t and wp.uint32(prim) < wp.uint32(best.prim))):
            best.t = t
            best.u = hit[1]
            best.v = hit[2]
            best.prim = prim
        return best

    @wp.func
    def offer_any(best: best_type, tmin: real, hit: vec3, prim: int):
        """Any hit in [tmin, t]."""
        if hit[0] >= tmin and hit[0] <= best.t:
            best.prim = prim
        return best

    @wp.func
    def offer_count(found: multi_hit_type, tmin: real, hit: vec3, prim: int):
        """Count the hits in [tmin, tmax]."""
        if hit[0] >= tmin and hit[0] <= found.tmax:
            found.count += 1
        return found

    @wp.func
    def offer_all(found: multi_hit_type, tmin: real, hit: vec3, prim: int):
        """List the hits in [tmin, tmax]."""
        if hit[0] >= tmin and hit[0] <= found.tmax:
            list_hit(found.hits, found.remaining, hit[0] / found.unscale, hit[1], hit[2], prim)
        return found

    return {
        "closest": Query(best_type, begin_best, offer_closest, limit_of_best, distance, in_order=True),
        "any": Query(best_type, begin_best, offer_any, limit_of_best, first_hit_ends=True),
        "count": Query(multi_hit_type, begin_multi_hit, offer_count, limit_of_all, crossings=True),
        "all": Query(multi_hit_type, begin_multi_hit, offer_all, limit_of_all, crossings=True),
        "count_touching": Query(multi_hit_type, begin_multi_hit, offer_count, limit_of_all),
        "all_touching": Query(multi_hit_type, begin_multi_hit, offer_all, limit_of_all),
    }


QUERIES = {
    "float32": make_queries("float32", Best, MultiHit),
    "float64": make_queries("float64", Best64, MultiHit64),
}
