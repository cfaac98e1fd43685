"""Minima of distances over a ray's threads: as integers that sort alike, and exactly in double."""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.lanes.layout import ALL_BITS, NO_PRIM, SIGN_BIT
from wive.warp_kernels.queries.frame import is_negative
from wive.warp_kernels.queries.query import Best64

ALL_BITS_64 = wp.constant(wp.uint64(0xFFFFFFFFFFFFFFFF))
SIGN_BIT_64 = wp.constant(wp.uint64(0x8000000000000000))


@wp.func
def sortable(t: float):
    """t as an integer that sorts as t does; -0 and 0 become the same integer."""
    bits = wp.cast(t + 0.0, wp.uint32)
    return bits ^ wp.where(is_negative(t + 0.0), ALL_BITS, SIGN_BIT)


@wp.func
def sortable(t: wp.float64):
    positive = t + wp.float64(0.0)
    return wp.cast(positive, wp.uint64) ^ wp.where(is_negative(positive), ALL_BITS_64, SIGN_BIT_64)


@wp.func
def unsortable(key: wp.uint32):
    """The t whose `sortable` is key."""
    positive = (key >> wp.uint32(31)) != wp.uint32(0)
    return wp.cast(key ^ wp.where(positive, SIGN_BIT, ALL_BITS), wp.float32)


def keep_nearest_double(lanes: SimpleNamespace) -> wp.Function:
    """Keep the nearest hit among a ray's eight threads; the others report a miss.

    Needed because the float32 t of boxes does not tell apart hits that differ in double.
    """
    min_reduce = lanes.min_reduce

    @without_gradient
    @wp.func
    def keep_nearest(units: wp.uint64, stack: lanes.stack_argument, lane: int, best: Best64):
        key = wp.where(best.prim == NO_PRIM, ALL_BITS_64, sortable(best.t))
        high = wp.uint32(key >> wp.uint64(32))
        low = wp.uint32(key & wp.uint64(0xFFFFFFFF))
        least_high = min_reduce(high)
        least_low = min_reduce(wp.where(high == least_high, low, ALL_BITS))
        if high != least_high or low != least_low:
            best.prim = NO_PRIM
        return best

    return keep_nearest
