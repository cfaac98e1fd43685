"""Kernels that turn the order lanes of uploaded nodes into what a lane needs to find its own place."""

import warp as wp

from wive.warp_kernels.lanes.layout import (
    BEHIND_ROW,
    COMPRESSED_NODE_WORDS,
    COMPRESSED_RANK_BITS,
    COMPRESSED_RANKS,
    NODE_WORDS,
    ORDER_BITS,
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
    """One thread per node: a byte for each slot in each of the octants 0 to 3, the slots that come behind it.

    Octant 7 - o is octant o backwards.
    """
    row = wp.tid() * NODE_WORDS + BEHIND_ROW
    behind = Lanes()
    for octant in range(4):
        later = wp.uint32(0)
        for i in range(8):
            order = wp.cast(units[row + 7 - i], wp.uint32)
            slot = (order >> wp.uint32(ORDER_BITS * octant)) & wp.uint32(7)
            word = 2 * octant + wp.int32(slot >> wp.uint32(2))
            behind[word] = behind[word] | (later << (wp.uint32(8) * (slot & wp.uint32(3))))
            later = later | (wp.uint32(1) << slot)
    for i in range(8):
        units[row + i] = wp.cast(behind[i], wp.float32)


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
