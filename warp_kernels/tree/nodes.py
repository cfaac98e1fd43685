"""The two node forms (layout.h, compressed.h): what a visit reads of a node, for either lane form.

rows_of(octant) says where in a node the rows begin that rays of an octant need: a byte per axis for the near
planes, and one for the order. grid(...) is what planes are relative to, and distances(...) are those to the
near and to the far planes of an axis, along the ray from its origin: plane * rdir + bias. (Numbers, not
vectors: the compiler of Warp's CPU device passes short vectors to functions as integers.)

order(...) is what a visit needs of the children's order; below(...) and lowest(...) say where on the stack a
slot's child goes among the hits. used(grid) has a bit for each slot that has a child.
"""

from types import SimpleNamespace
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.compressed_native import BYTE_DISTANCES_1, BYTE_DISTANCES_8, GRID
from wive.warp_kernels.lanes.lanes import byte_of
from wive.warp_kernels.lanes.layout import (
    ALL_BITS,
    BEHIND_ROW,
    CHILD_ROW,
    COMPRESSED_BEHIND_ROW,
    COMPRESSED_CHILD_ROW,
    COMPRESSED_NODE_WORDS,
    COMPRESSED_PLANES,
    NODE_WIDTH,
    NODE_WORDS,
)
from wive.warp_kernels.lanes.native import BEHIND_1, BEHIND_8

ORDER_BYTE = 3  # of rows_of
FLOAT_ROW_BYTES, BYTE_ROW_BYTES = 4 * NODE_WIDTH, NODE_WIDTH


def float32_node(lanes: SimpleNamespace) -> SimpleNamespace:
    """Rows of floats; empty lanes hold boxes that nothing hits."""
    plane_distances = lanes.plane_distances

    @wp.func
    def grid(units: wp.uint64, node: int):
        return wp.vec4()

    @wp.func
    def distances(
        units: wp.uint64,
        node: int,
        grid: wp.vec4,
        lane: int,
        axis: int,
        near_row: int,
        near_rdir: float,
        far_rdir: float,
        near_bias: float,
        far_bias: float,
    ):
        far_row = near_row ^ FLOAT_ROW_BYTES
        near = plane_distances(units, node, lane, near_row, near_rdir, near_bias)
        return near, plane_distances(units, node, lane, far_row, far_rdir, far_bias)

    @wp.func
    def used(grid: wp.vec4):
        return ALL_BITS

    return SimpleNamespace(
        words=NODE_WORDS,
        child_row=CHILD_ROW,
        grid=grid,
        distances=distances,
        used=used,
        **_places(lanes, first_plane=0, row_bytes=FLOAT_ROW_BYTES, order_byte=4 * BEHIND_ROW),
    )


def compressed_node(lanes: SimpleNamespace) -> SimpleNamespace:
    """Rows of bytes on a grid given by an origin and three steps; empty lanes have no child."""
    length: int = lanes.length
    vector: Any = lanes.vector
    both_vectors = wp.types.vector(length=2 * length, dtype=wp.float32)

    @wp.func_native(GRID)
    def grid(units: wp.uint64, node: int) -> wp.vec4: ...

    @wp.func_native(BYTE_DISTANCES_8 if length == 8 else BYTE_DISTANCES_1)
    def byte_distances(
        units: wp.uint64,
        node: int,
        grid: wp.vec4,
        lane: int,
        axis: int,
        near_row: int,
        near_rdir: float,
        far_rdir: float,
        near_bias: float,
        far_bias: float,
    ) -> both_vectors: ...

    @wp.func
    def distances(
        units: wp.uint64,
        node: int,
        grid: wp.vec4,
        lane: int,
        axis: int,
        near_row: int,
        near_rdir: float,
        far_rdir: float,
        near_bias: float,
        far_bias: float,
    ):
        both = byte_distances(
            units, node, grid, lane, axis, near_row, near_rdir, far_rdir, near_bias, far_bias
        )
        near = vector()
        far = vector()
        for i in range(length):
            near[i] = both[i]
            far[i] = both[length + i]
        return near, far

    @wp.func
    def used(grid: wp.vec4):
        return wp.cast(grid[3], wp.uint32) >> wp.uint32(24)

    return SimpleNamespace(
        words=COMPRESSED_NODE_WORDS,
        child_row=COMPRESSED_CHILD_ROW,
        grid=grid,
        distances=distances,
        used=used,
        **_places(
            lanes,
            first_plane=4 * COMPRESSED_PLANES,
            row_bytes=BYTE_ROW_BYTES,
            order_byte=4 * COMPRESSED_BEHIND_ROW,
        ),
    )


def _places(
    lanes: SimpleNamespace, *, first_plane: int, row_bytes: int, order_byte: int
) -> dict[str, wp.Function]:
    """Where rows begin in a node of this form, in bytes, and the order, which both forms store alike."""
    eight: bool = lanes.length == 8
    low_rows = [first_plane + 2 * row_bytes * axis for axis in range(3)]
    lowest_rows = int.from_bytes(bytes([*low_rows, order_byte]), "little", signed=True)
    to_sign = 32 - (row_bytes << 16).bit_length()

    @wp.func
    def low_row(axis: int):
        """The low planes of an axis; its high planes are behind them."""
        return first_plane + 2 * row_bytes * axis

    @wp.func
    def rows_of(octant: int):
        # Octant 7 - o is octant o backwards.
        rows = lowest_rows + (NODE_WIDTH << 24) * wp.where(octant > 3, 7 - octant, octant)
        # Bit a of the octant, moved into byte a: it chooses between rows.
        return wp.uint32(rows + ((octant * (row_bytes * 0x4081)) & (row_bytes * 0x10101)))

    @wp.func_native(BEHIND_8 if eight else BEHIND_1)
    def load_behind(units: wp.uint64, node: int, row: int, lane: int) -> wp.vec2ui: ...

    @wp.func
    def order(units: wp.uint64, node: int, lane: int, rows: wp.uint32):
        """The slots behind each slot in octants 0 to 3, and whether the ray's octant is one backwards."""
        behind = load_behind(units, node, byte_of(rows, ORDER_BYTE), lane)
        # Backwards from the high z planes to the low ones: their bit, in all places.
        backwards = wp.cast(rows << wp.uint32(to_sign), wp.int32) >> 31
        return wp.vec3ui(behind[0], behind[1], wp.uint32(backwards))

    @wp.func
    def below(order: wp.vec3ui, hits: wp.uint32):
        """A byte for each slot: the hits that go below its own on the stack, and its own if backwards."""
        in_bytes = hits * wp.uint32(0x01010101)
        return wp.vec2ui((order[0] ^ order[2]) & in_bytes, (order[1] ^ order[2]) & in_bytes)

    @wp.func
    def lowest(order: wp.vec3ui, top: int):
        """Where on the stack a hit goes that has none in its byte of `below`."""
        return top + wp.cast(order[2], wp.int32)

    return {
        "low_row": low_row, "rows_of": rows_of,
        "order": order, "below": below, "lowest": lowest,
    }  # fmt: skip


NODES = {"float32": float32_node, "compressed": compressed_node}
