"""The order row of a node, inverted where the tree lies."""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

import warp as wp

from wive.warp_kernels.handle import NODE_WIDTH, RANK_ROW


@wp.kernel(enable_backward=False, module="unique")
def invert_orders(units: wp.array(dtype=wp.float32)):
    """Of one node: lane i, which held the i-th slot of each octant's order, gets slot i's place in it."""
    row = wp.tid() * wp.static(8 * NODE_WIDTH) + wp.static(RANK_ROW)
    ranks = wp.vector(dtype=wp.uint32, length=8)
    for place in range(8):
        order = wp.cast(units[row + place], wp.uint32)
        for octant in range(8):
            shift = wp.uint32(4 * octant)
            slot = int((order >> shift) & wp.uint32(7))
            ranks[slot] = ranks[slot] | (wp.uint32(place) << shift)
    for slot in range(8):
        units[row + slot] = wp.cast(ranks[slot], wp.float32)
