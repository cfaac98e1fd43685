"""The queries of exact trees: hits are offered once they are known to lie within the limits."""

from dataclasses import replace

import warp as wp

from wive.warp_kernels.lanes.layout import NO_PRIM
from wive.warp_kernels.queries.frame import RayFrame
from wive.warp_kernels.queries.query import QUERIES, Best, MultiHit, Query, list_hit


@wp.struct
class ExactBest:
    """The best hit so far; t is for the boxes alone, in the frame's units."""

    t: wp.float32
    given_t: wp.float32  # in the caller's units, the nearest float to the exact value
    u: wp.float32
    v: wp.float32
    prim: wp.int32
    place: wp.int32  # of its triangle in the tree, so that equal t can be compared exactly


@wp.func
def begin_exact(ray: RayFrame):
    """Nothing hit yet."""
    best = ExactBest()
    best.t = ray.tmax
    best.given_t = wp.inf
    best.prim = NO_PRIM
    return best


@wp.func
def exact_distance(best: ExactBest, unscale: float):
    """t in the caller's units."""
    return best.given_t


@wp.func
def offer_any(best: Best, hit: wp.vec4, prim: int):
    """Any hit."""
    best.prim = prim
    return best


@wp.func
def offer_count(found: MultiHit, hit: wp.vec4, prim: int):
    """Count every hit."""
    found.count += 1
    return found


@wp.func
def offer_all(found: MultiHit, hit: wp.vec4, prim: int):
    """List every hit."""
    list_hit(found.hits, found.remaining, hit[0], hit[1], hit[2], prim)
    return found


_FLOAT32 = QUERIES["float32"]
# The closest hit has no `offer` here: triangle_exact.py compares distances, for which it needs the tree.
EXACT_QUERIES = {
    "closest": replace(
        _FLOAT32["closest"],
        state=ExactBest,
        begin=begin_exact,
        offer=None,
        limit=None,
        distance=exact_distance,
    ),
    "any": replace(_FLOAT32["any"], offer=offer_any),
    "count": replace(_FLOAT32["count"], offer=offer_count),
    "all": replace(_FLOAT32["all"], offer=offer_all),
    "count_touching": replace(_FLOAT32["count_touching"], offer=offer_count),
    "all_touching": replace(_FLOAT32["all_touching"], offer=offer_all),
}


def query_of(query: str, accuracy: str, precision: str = "float32") -> Query:
    """The query of that name in trees of this accuracy and precision."""
    return (EXACT_QUERIES if accuracy == "exact" else QUERIES[precision])[query]
