"""What queries of an exact tree keep, as query_exact.h: hits are offered once they are known to count."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.queries.frame import RayFrame
from wive.warp_kernels.queries.query import QUERIES, Best, distance_of
from wive.warp_kernels.queries.query_all import Crossings, list_hit
from wive.warp_kernels.tree.handle import NO_PRIM


@wp.struct
class ExactBest:
    """The best hit so far; t is for the boxes alone, in the frame's units."""

    t: wp.float32
    given_t: wp.float32  # in the caller's units, the nearest float to the exact value
    u: wp.float32
    v: wp.float32
    prim: wp.int32
    place: wp.int32  # where in the tree its triangle is, to compare it again


@wp.func
def begin_exact(ray: RayFrame):
    """Nothing hit yet."""
    best = ExactBest()
    best.t = ray.tmax
    best.given_t = wp.inf
    best.prim = wp.static(NO_PRIM)
    return best


@wp.func
def distance_of(best: ExactBest, scale: float):  # noqa: F811
    """t in the caller's units."""
    return best.given_t


@wp.func
def exact_done(best: ExactBest):
    """Whether one thread's hits end the query."""
    return False


@wp.func
def take_any(best: Best, hit: wp.vec4, prim: int):
    """Any hit."""
    best.prim = prim
    return best


@wp.func
def take_count(found: Crossings, hit: wp.vec4, prim: int):
    """Count every hit."""
    found.count += 1
    return found


@wp.func
def take_all(found: Crossings, hit: wp.vec4, prim: int):
    """List every hit."""
    list_hit(found.hits, found.left, hit[0], hit[1], hit[2], prim)
    return found


# As QUERIES; `take` keeps a hit that lies within the limits, and is None where it has to compare.
_FLOAT32 = QUERIES["float32"]
EXACT_QUERIES = {
    "closest": SimpleNamespace(
        **{**vars(_FLOAT32["closest"]), "state": ExactBest, "begin": begin_exact, "done": exact_done},
        take=None,
    ),
    "any": SimpleNamespace(**vars(_FLOAT32["any"]), take=take_any),
    "count": SimpleNamespace(**vars(_FLOAT32["count"]), take=take_count),
    "all": SimpleNamespace(**vars(_FLOAT32["all"]), take=take_all),
}
