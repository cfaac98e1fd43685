"""The forms of a triangle block (layout.h, compressed.h): where a block's corners and prims are.

All forms offer the same functions. A vertex is at the word `vertex_at`, its axes `stride` words apart.
`block_at` is the i-th block of a leaf. `corners` are the k-th corners of the thread's triangles on three
axes, in cyclic order, and `corner` that of one triangle. Uncompressed blocks of `fast` trees store edges
from the first corner in place of the others: `edge_of` makes one of what is stored, and `edges_of` of
what vectors store. `used` clears the lanes that hold no triangle.
"""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.compressed_native import CORNERS_1, CORNERS_4
from wive.warp_kernels.lanes.lanes import load_float, without_gradient
from wive.warp_kernels.lanes.layout import (
    BLOCK_WIDTH,
    BLOCK_WORDS,
    CORNER_BITS,
    EXTRA_WORD,
    HEADER_VERTEX,
    LEAST_COMPRESSED_WORDS,
    MOST_VERTICES,
    NUMBER_BITS,
    PRIM_ROW,
    USED_SHIFT,
    VERTEX_WORDS,
    VERTICES_SHIFT,
)
from wive.warp_kernels.lanes.native import BLOCK_ROW
from wive.warp_kernels.lanes.precision import PRECISIONS


def plain_block(lanes: SimpleNamespace, precision: str) -> SimpleNamespace:
    """Four triangles side by side; NaN fails every test in the unused lanes."""
    load_triangles = lanes.load_triangles
    numbers = PRECISIONS[precision]
    real, vec3, load_number, vector = numbers.real, numbers.vec3, numbers.load, lanes.triangles
    words: int = numbers.words
    own: bool = lanes.triangles_length == 1
    block_words: int = BLOCK_WORDS * words
    row_words: int = BLOCK_WIDTH * words
    vertex_words: int = 3 * row_words

    @wp.func_native(BLOCK_ROW.replace("BYTES", str(4 * row_words)))
    def row_at(units: wp.uint64, at: int, axis: int) -> wp.uint64: ...

    @wp.func
    def block_at(units: wp.uint64, begin: int, i: int):
        return begin + block_words * i

    @wp.func
    def stride(units: wp.uint64, block: int):
        return row_words

    @wp.func
    def vertex_at(units: wp.uint64, block: int, k: int, j: int):
        return block + vertex_words * k + words * j

    @wp.func
    def prim_at(units: wp.uint64, block: int, j: int):
        return block + PRIM_ROW * words + j

    @wp.func
    def corners(units: wp.uint64, block: int, lane: int, k: int, axes: wp.vec3i):
        at = block + words * wp.where(own, lane & 3, 0)
        x = load_triangles(row_at(units, at, axes[0]), k)
        y = load_triangles(row_at(units, at, axes[1]), k)
        z = load_triangles(row_at(units, at, axes[2]), k)
        return x, y, z

    @wp.func
    def corner(units: wp.uint64, block: int, k: int, j: int, axes: wp.vec3i):
        at = block + words * j
        return vec3(
            load_number(row_at(units, at, axes[0]), vertex_words * k),
            load_number(row_at(units, at, axes[1]), vertex_words * k),
            load_number(row_at(units, at, axes[2]), vertex_words * k),
        )

    @wp.func
    def edge_of(stored: real, v0: real):
        return stored

    @wp.func
    def edges_of(stored: vector, v0: vector):
        return stored

    @wp.func
    def used(units: wp.uint64, block: int, lane: int, passed: wp.uint32):
        return passed

    return _block(block_words, block_at, stride, vertex_at, prim_at, corners, corner, edge_of, edges_of, used)


def compressed_block(lanes: SimpleNamespace) -> SimpleNamespace:
    """Up to four triangles over six or eight vertices; the header says which lanes are used."""
    length: int = lanes.triangles_length
    vector = lanes.triangles
    axes_in_lanes = wp.types.vector(length=3 * length, dtype=wp.float32)

    @wp.func
    def header(units: wp.uint64, block: int, word: int):
        at = block + VERTEX_WORDS * (HEADER_VERTEX + word) + EXTRA_WORD
        return wp.cast(load_float(units, at), wp.uint32)

    @wp.func
    def corner_numbers(units: wp.uint64, block: int, k: int):
        """The vertex numbers of corner k in the low bits: two corners share a word of the header."""
        return header(units, block, k // 2) >> wp.uint32(CORNER_BITS * (k % 2))

    @wp.func
    def stride(units: wp.uint64, block: int):
        return 1

    @wp.func
    def block_at(units: wp.uint64, begin: int, i: int):
        at = int(begin)
        for _ in range(i):  # rarely more than once
            vertices = (header(units, at, 1) >> wp.uint32(VERTICES_SHIFT)) & MOST_VERTICES
            at += VERTEX_WORDS * int(vertices)
        return at

    @wp.func
    def vertex_at(units: wp.uint64, block: int, k: int, j: int):
        number = corner_numbers(units, block, k) >> wp.uint32(NUMBER_BITS * j)
        return block + VERTEX_WORDS * int(number & wp.uint32(7))

    @wp.func
    def prim_at(units: wp.uint64, block: int, j: int):
        return block + VERTEX_WORDS * j + EXTRA_WORD

    @wp.func_native(CORNERS_4 if length == 4 else CORNERS_1)
    def load_corners(
        units: wp.uint64, block: int, numbers: wp.uint32, lane: int, longest: int
    ) -> axes_in_lanes: ...

    @wp.func_native(CORNERS_1)
    def load_corner(units: wp.uint64, block: int, numbers: wp.uint32, lane: int, longest: int) -> wp.vec3: ...

    @wp.func
    def corners(units: wp.uint64, block: int, lane: int, k: int, axes: wp.vec3i):
        found = load_corners(units, block, corner_numbers(units, block, k), lane, axes[2])
        x = vector()
        y = vector()
        z = vector()
        for i in range(length):
            x[i] = found[i]
            y[i] = found[length + i]
            z[i] = found[2 * length + i]
        return x, y, z

    @wp.func
    def corner(units: wp.uint64, block: int, k: int, j: int, axes: wp.vec3i):
        return load_corner(units, block, corner_numbers(units, block, k), j, axes[2])

    @wp.func
    def edge_of(stored: float, v0: float):
        return stored - v0

    @wp.func
    def edges_of(stored: vector, v0: vector):
        return stored - v0

    @wp.func
    def used(units: wp.uint64, block: int, lane: int, passed: wp.uint32):
        used_lanes = (header(units, block, 1) >> wp.uint32(USED_SHIFT)) & wp.uint32(15)
        return passed & (used_lanes >> wp.uint32(wp.where(length == 1, lane & 3, 0)))

    least: int = LEAST_COMPRESSED_WORDS
    return _block(least, block_at, stride, vertex_at, prim_at, corners, corner, edge_of, edges_of, used)


def _block(least_words: int, *functions: wp.Function) -> SimpleNamespace:
    """A form by its functions, which are named as all forms name them."""
    found = {function.func.__name__: without_gradient(function) for function in functions}
    return SimpleNamespace(least_words=least_words, **found)


def block_form(lanes: SimpleNamespace, nodes: str, precision: str) -> SimpleNamespace:
    """The block form of a tree with this node form: blocks of float64 are never compressed."""
    if nodes == "compressed" and precision == "float32":
        return compressed_block(lanes)
    return plain_block(lanes, precision)
