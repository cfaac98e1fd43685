"""Kernels that turn the order lanes of uploaded nodes into ranks."""

import warp as wp

from wive.warp_kernels.lanes.layout import (
    COMPRESSED_NODE_WORDS,
    COMPRESSED_RANK_BITS,
    COMPRESSED_RANKS,
    NODE_WORDS,
    RANK_BITS,
    RANK_ROW,
)

Lanes = wp.types.vector(dtype=wp.uint32, length=8)


@wp.func
def inverted(orders: Lanes, bits: int) -> Lanes:
    """The ranks of an order: lane i, which held the i-th slot of each octant, gets slot i's place."""
    ranks = Lanes()
    for place in range(8):
        for octant in range(8):
            shift = wp.uint32(bits * octant)
            slot = int((orders[place] >> shift) & wp.uint32(7))
            ranks[slot] = ranks[slot] | (wp.uint32(place) << shift)
    return ranks


@wp.kernel(enable_backward=False, module="unique")
def invert_orders(units: wp.array(dtype=wp.float32)):
    """One thread per node, one word per lane."""
    row = wp.tid() * NODE_WORDS + RANK_ROW
    orders = Lanes()
    for i in range(8):
        orders[i] = wp.cast(units[row + i], wp.uint32)
    ranks = inverted(orders, RANK_BITS)
    for i in range(8):
        units[row + i] = wp.cast(ranks[i], wp.float32)


@wp.kernel(enable_backward=False, module="unique")
def invert_compressed_orders(units: wp.array(dtype=wp.float32)):
    """One thread per node, three bytes per lane: three words hold four lanes."""
    row = wp.tid() * COMPRESSED_NODE_WORDS + COMPRESSED_RANKS
    orders = Lanes()
    for half in range(2):
        a = wp.cast(units[row + 3 * half], wp.uint32)
        b = wp.cast(units[row + 3 * half + 1], wp.uint32)
        c = wp.cast(units[row + 3 * half + 2], wp.uint32)
        orders[4 * half] = a
        orders[4 * half + 1] = (a >> wp.uint32(24)) | (b << wp.uint32(8))
        orders[4 * half + 2] = (b >> wp.uint32(16)) | (c << wp.uint32(16))
        orders[4 * half + 3] = c >> wp.uint32(8)
    ranks = inverted(orders, COMPRESSED_RANK_BITS)
    for half in range(2):
        a = ranks[4 * half] | (ranks[4 * half + 1] << wp.uint32(24))
        b = (ranks[4 * half + 1] >> wp.uint32(8)) | (ranks[4 * half + 2] << wp.uint32(16))
        c = (ranks[4 * half + 2] >> wp.uint32(16)) | (ranks[4 * half + 3] << wp.uint32(8))
        units[row + 3 * half] = wp.cast(a, wp.float32)
        units[row + 3 * half + 1] = wp.cast(b, wp.float32)
        units[row + 3 * half + 2] = wp.cast(c, wp.float32)


INVERT_ORDERS = {"float32": invert_orders, "compressed": invert_compressed_orders}
