"""What a query keeps of the hits it is offered, as cpu/traverse/query.h."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.frame import RayFrame, RayFrame64
from wive.warp_kernels.queries.query_all import Crossings, Crossings64, begin_crossings, crossing_offers
from wive.warp_kernels.tree.handle import NO_PRIM


@wp.struct
class Best:
    """The best hit so far, in the frame's units: t falls with every hit found."""

    t: wp.float32
    u: wp.float32
    v: wp.float32
    prim: wp.int32


@wp.struct
class Best64:
    """The same in a float64 tree."""

    t: wp.float64
    u: wp.float64
    v: wp.float64
    prim: wp.int32


@wp.func
def begin_best(ray: RayFrame):
    """Nothing hit yet."""
    best = Best()
    best.t = ray.tmax
    best.prim = wp.static(NO_PRIM)
    return best


@wp.func
def begin_best(ray: RayFrame64):  # noqa: D103, F811
    best = Best64()
    best.t = ray.tmax
    best.prim = wp.static(NO_PRIM)
    return best


@wp.func
def distance_of(best: Best, scale: float):
    """t in the caller's units."""
    return best.t * scale


@wp.func
def distance_of(best: Best64, scale: wp.float64):  # noqa: D103, F811
    return best.t * scale


def make_queries(precision: str, best_type: type, crossings_type: type) -> dict[str, SimpleNamespace]:
    """The queries by name, for trees of that precision.

    in_order: children are met from front to back and kept with their distances, because tmax falls with every
    hit. one_is_enough: a hit of any thread ends the query. crossings: how many hits there are matters.
    """
    real, vec3 = PRECISIONS[precision].real, PRECISIONS[precision].vec3
    offer_count, offer_all, never_done = crossing_offers(crossings_type, real, vec3)

    @wp.func
    def offer_closest(best: best_type, tmin: real, hit: vec3, prim: int):
        """The nearest hit in [tmin, t]; of hits at one t the lowest prim, in whatever order they come."""
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
    def closest_done(best: best_type):
        """Whether one thread's hits end the query."""
        return False

    @wp.func
    def any_done(best: best_type):
        """Whether one thread's hits end the query."""
        return best.prim != wp.static(NO_PRIM)

    return {
        "closest": SimpleNamespace(
            in_order=True,
            one_is_enough=False,
            crossings=False,
            state=best_type,
            begin=begin_best,
            offer=offer_closest,
            done=closest_done,
        ),
        "any": SimpleNamespace(
            in_order=False,
            one_is_enough=True,
            crossings=False,
            state=best_type,
            begin=begin_best,
            offer=offer_any,
            done=any_done,
        ),
        "count": SimpleNamespace(
            in_order=False,
            one_is_enough=False,
            crossings=True,
            state=crossings_type,
            begin=begin_crossings,
            offer=offer_count,
            done=never_done,
        ),
        "all": SimpleNamespace(
            in_order=False,
            one_is_enough=False,
            crossings=True,
            state=crossings_type,
            begin=begin_crossings,
            offer=offer_all,
            done=never_done,
        ),
    }


QUERIES = {
    "float32": make_queries("float32", Best, Crossings),
    "float64": make_queries("float64", Best64, Crossings64),
}
