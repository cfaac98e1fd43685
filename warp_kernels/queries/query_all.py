"""What queries for everything along a ray keep of the hits they are offered, as cpu/traverse/query_all.h."""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.lanes.native import LIST_HIT
from wive.warp_kernels.queries.frame import RayFrame, RayFrame64


@wp.struct
class Crossings:
    """How many triangles one thread has met, and where it puts them."""

    t: wp.float32  # the farthest that is asked for, in the frame's units
    count: wp.int32
    scale: wp.float32  # t of the caller's ray = scale * t here
    hits: wp.uint64  # address of the ray's first `Hit`
    left: wp.uint64  # address of the number of them that are still to come


@wp.struct
class Crossings64:
    """The same in a float64 tree."""

    t: wp.float64
    count: wp.int32
    scale: wp.float64
    hits: wp.uint64  # address of the ray's first `Hit64`
    left: wp.uint64


@wp.func
def begin_crossings(ray: RayFrame):
    """Nothing met yet."""
    none = Crossings()
    none.t = ray.tmax
    return none


@wp.func
def begin_crossings(ray: RayFrame64):  # noqa: D103, F811
    none = Crossings64()
    none.t = ray.tmax
    return none


@wp.func_native(LIST_HIT.replace("REAL", "float"))
def list_hit(hits: wp.uint64, left: wp.uint64, t: float, u: float, v: float, prim: int):
    """Put a hit where the last one that is still to come belongs; the ray's other threads do so, too."""
    ...


@wp.func_native(LIST_HIT.replace("REAL", "double"))
def list_hit(  # noqa: D103, F811
    hits: wp.uint64, left: wp.uint64, t: wp.float64, u: wp.float64, v: wp.float64, prim: int
): ...


def crossing_offers(crossings: type, real: type, vec3: type) -> tuple[wp.Function, wp.Function, wp.Function]:
    """Count every hit in [tmin, t], list every one, and whether one thread's hits end the query."""

    @wp.func
    def offer_count(found: crossings, tmin: real, hit: vec3, prim: int):
        if hit[0] >= tmin and hit[0] <= found.t:
            found.count += 1
        return found

    @wp.func
    def offer_all(found: crossings, tmin: real, hit: vec3, prim: int):
        if hit[0] >= tmin and hit[0] <= found.t:
            list_hit(found.hits, found.left, hit[0] * found.scale, hit[1], hit[2], prim)
        return found

    @wp.func
    def never_done(found: crossings):
        return False

    return offer_count, offer_all, never_done
