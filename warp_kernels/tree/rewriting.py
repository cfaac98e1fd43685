"""Kernels that rewrite uploaded nodes and blocks, in place, so that threads read few and wide words.

One thread per node. `layout.py` describes what is read and what is written.
"""

import warp as wp

from wive.warp_kernels.lanes.layout import (
    ALL_BITS,
    BEHIND_ROW,
    BLOCK_WIDTH,
    COMPRESSED_BEHIND_ROW,
    COMPRESSED_CHILD_ROW,
    COMPRESSED_NODE_WORDS,
    COMPRESSED_PLANES,
    CORE_COMPRESSED_ORDER,
    CORE_COMPRESSED_ORDER_BITS,
    CORE_COMPRESSED_PLANES,
    CORE_COMPRESSED_STEP,
    CORE_HEADER_WORDS,
    EXTRA_WORD,
    HEADER_VERTEX,
    NODE_WIDTH,
    NODE_WORDS,
    ORDER_BITS,
    VERTEX_WORDS,
    VERTICES_SHIFT,
    WORD_MASK,
)

Lanes = wp.types.vector(dtype=wp.uint32, length=NODE_WIDTH)
Planes = wp.types.vector(dtype=wp.float32, length=COMPRESSED_BEHIND_ROW - COMPRESSED_PLANES)
Block = wp.types.vector(dtype=wp.float32, length=CORE_HEADER_WORDS + 3 * 8 + BLOCK_WIDTH)


@wp.func
def slots_behind(orders: Lanes, bits: int) -> Lanes:
    """A byte for each slot in each of the octants 0 to 3: the slots that come behind it.

    Lane i of `orders` holds, in so many bits per octant, the slot that comes i-th from front to back.
    """
    behind = Lanes()
    for octant in range(4):
        later = wp.uint32(0)
        for i in range(8):
            slot = (orders[7 - i] >> wp.uint32(bits * octant)) & wp.uint32(7)
            word = 2 * octant + wp.int32(slot >> wp.uint32(2))
            behind[word] = behind[word] | (later << (wp.uint32(8) * (slot & wp.uint32(3))))
            later = later | (wp.uint32(1) << slot)
    return behind


@wp.kernel(enable_backward=False, module="unique")
def rewrite_nodes(units: wp.array(dtype=wp.float32)):
    """The slots behind each slot, in place of the order row."""
    row = wp.tid() * NODE_WORDS + BEHIND_ROW
    orders = Lanes()
    for i in range(8):
        orders[i] = wp.cast(units[row + i], wp.uint32)
    behind = slots_behind(orders, ORDER_BITS)
    for i in range(8):
        units[row + i] = wp.cast(behind[i], wp.float32)


@wp.kernel(enable_backward=False, module="unique")
def rewrite_compressed_nodes(units: wp.array(dtype=wp.float32)):
    """One word for the steps and the slots in use, the planes behind it, then the slots behind each slot."""
    node = wp.tid() * COMPRESSED_NODE_WORDS
    grid = wp.uint32(0)
    for axis in range(3):
        step = wp.cast(units[node + CORE_COMPRESSED_STEP + axis], wp.uint32)
        grid = grid | ((step >> wp.uint32(23)) << wp.uint32(8 * axis))
    for slot in range(NODE_WIDTH):
        if wp.cast(units[node + COMPRESSED_CHILD_ROW + slot], wp.uint32) != ALL_BITS:
            grid = grid | (wp.uint32(1) << wp.uint32(24 + slot))
    planes = Planes()
    for i in range(len(planes)):
        planes[i] = units[node + CORE_COMPRESSED_PLANES + i]
    orders = Lanes()
    for half in range(2):  # three words hold four lanes
        row = node + CORE_COMPRESSED_ORDER + 3 * half
        a = wp.cast(units[row], wp.uint32)
        b = wp.cast(units[row + 1], wp.uint32)
        c = wp.cast(units[row + 2], wp.uint32)
        orders[4 * half] = a
        orders[4 * half + 1] = (a >> wp.uint32(24)) | (b << wp.uint32(8))
        orders[4 * half + 2] = (b >> wp.uint32(16)) | (c << wp.uint32(16))
        orders[4 * half + 3] = c >> wp.uint32(8)
    behind = slots_behind(orders, CORE_COMPRESSED_ORDER_BITS)
    units[node + 3] = wp.cast(grid, wp.float32)
    for i in range(len(planes)):
        units[node + COMPRESSED_PLANES + i] = planes[i]
    for i in range(8):
        units[node + COMPRESSED_BEHIND_ROW + i] = wp.cast(behind[i], wp.float32)


@wp.kernel(enable_backward=False, module="unique")
def rewrite_compressed_blocks(units: wp.array(dtype=wp.float32)):
    """The blocks of a node's leaves: four words per vertex, behind whose coordinates prims and header lie."""
    children = wp.tid() * COMPRESSED_NODE_WORDS + COMPRESSED_CHILD_ROW
    for slot in range(NODE_WIDTH):
        child = wp.cast(units[children + slot], wp.uint32)
        if child != ALL_BITS and wp.int32(child) < 0:
            block = wp.int32(child) & WORD_MASK
            for _ in range((wp.int32(child) & 7) + 1):
                vertices = wp.int32(wp.cast(units[block + 1], wp.uint32) >> wp.uint32(VERTICES_SHIFT))
                old = Block()
                for i in range(CORE_HEADER_WORDS + 3 * vertices + BLOCK_WIDTH):
                    old[i] = units[block + i]
                for i in range(vertices):
                    at = block + VERTEX_WORDS * i
                    for axis in range(3):
                        units[at + axis] = old[CORE_HEADER_WORDS + axis * vertices + i]
                    if i < BLOCK_WIDTH:
                        units[at + EXTRA_WORD] = old[CORE_HEADER_WORDS + 3 * vertices + i]
                for i in range(CORE_HEADER_WORDS):
                    units[block + VERTEX_WORDS * (HEADER_VERTEX + i) + EXTRA_WORD] = old[i]
                block += VERTEX_WORDS * vertices


# By node form and precision: blocks of float64 are never compressed.
REWRITES = {
    ("float32", "float32"): [rewrite_nodes],
    ("float32", "float64"): [rewrite_nodes],
    ("compressed", "float32"): [rewrite_compressed_nodes, rewrite_compressed_blocks],
    ("compressed", "float64"): [rewrite_compressed_nodes],
}
