"""Distances as integers that sort alike, and which of a ray's threads has the nearest hit in double."""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.queries.frame import is_negative
from wive.warp_kernels.queries.query import Best64
from wive.warp_kernels.tree.handle import ALL_BITS, NO_PRIM, SIGN_BIT

ALL_BITS_64 = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))
SIGN_BIT_64 = wp.constant(wp.uint64(0x8000000000000000))


@wp.func
def sortable(t: float):
    """t as an integer that sorts as t does; -0 and 0 are one."""
    bits = wp.cast(t + 0.0, wp.uint32)
    return bits ^ wp.where(is_negative(t + 0.0), ALL_BITS, SIGN_BIT)


@wp.func
def sortable(t: wp.float64):  # noqa: D103, F811
    positive = t + wp.float64(0.0)
    return wp.cast(positive, wp.uint64) ^ wp.where(is_negative(positive), ALL_BITS_64, SIGN_BIT_64)


@wp.func
def unsortable(key: wp.uint32):
    """The t whose `sortable` is key."""
    positive = (key >> wp.uint32(31)) != wp.uint32(0)
    return wp.cast(key ^ wp.where(positive, SIGN_BIT, ALL_BITS), wp.float32)


def settle_doubles(lanes: SimpleNamespace) -> wp.Function:
    """Of a ray's threads, those without the nearest hit lose theirs: what boxes go by does not tell them."""
    min_reduce = lanes.min_reduce

    @without_gradient
    @wp.func
    def settle(units: wp.uint64, stack: lanes.stack_argument, lane: int, best: Best64):
        key = wp.where(best.prim == wp.static(NO_PRIM), ALL_BITS_64, sortable(best.t))
        high = wp.uint32(key >> wp.uint64(32))
        low = wp.uint32(key & wp.uint64(0xFFFFFFFF))
        least_high = min_reduce(high)
        least_low = min_reduce(wp.where(high == least_high, low, ALL_BITS))
        if high != least_high or low != least_low:
            best.prim = wp.static(NO_PRIM)
        return best

    return settle
