"""The normal of a triangle that a traversal found, from the corners that its block holds."""

from typing import Any

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.lanes.layout import BLOCK_WIDTH
from wive.warp_kernels.lanes.precision import PRECISIONS


def make_normal(accuracy: str, precision: str) -> Any:
    """The function from a triangle's place in an uncompressed tree to its normal, not of unit length.

    A block begins with rows of four numbers, the x, y and z of three corners; blocks of fast trees hold the
    edges to the other corners in place of these.
    """
    words: int = PRECISIONS[precision].words
    load = PRECISIONS[precision].load
    row_words: int = BLOCK_WIDTH * words
    fast: bool = accuracy == "fast"

    @without_gradient
    @wp.func
    def corner(units: wp.uint64, first: int, k: int):
        at = first + 3 * row_words * k
        return wp.vec3d(
            wp.float64(load(units, at)),
            wp.float64(load(units, at + row_words)),
            wp.float64(load(units, at + 2 * row_words)),
        )

    @without_gradient
    @wp.func
    def normal(units: wp.uint64, place: int):
        lane = place & 7
        first = place - lane + words * lane
        one = corner(units, first, 1)
        other = corner(units, first, 2)
        if wp.static(not fast):
            origin = corner(units, first, 0)
            one -= origin
            other -= origin
        return wp.cross(one, other)

    return normal
