"""The forms of a triangle block (layout.h, compressed.h): where a block's corners and prims are.

All forms offer the same functions. A vertex is at the word `vertex_at`, its axes `stride` words apart.
`block_at` is the i-th block of a leaf. `load` reads one corner of the thread's triangles on one axis; `edge`
and `edge_at` read the edge from the first corner to another, which uncompressed blocks of `fast` trees store
in place of the corner. `used` clears the lanes that hold no triangle.
"""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import load_float, without_gradient
from wive.warp_kernels.lanes.layout import (
    BLOCK_WIDTH,
    BLOCK_WORDS,
    CORNER_BITS,
    HEADER_WORDS,
    LEAST_COMPRESSED_WORDS,
    NUMBER_BITS,
    PRIM_ROW,
    USED_SHIFT,
    VERTICES_SHIFT,
)
from wive.warp_kernels.lanes.native import PICK_1, PICK_4
from wive.warp_kernels.lanes.precision import PRECISIONS


def plain_block(lanes: SimpleNamespace, precision: str) -> SimpleNamespace:
    """Four triangles side by side; NaN fails every test in the unused lanes."""
    load_triangles = lanes.load_triangles
    numbers = PRECISIONS[precision]
    real, load_number = numbers.real, numbers.load
    words: int = numbers.words
    block_words: int = BLOCK_WORDS * words
    row_words: int = BLOCK_WIDTH * words
    vertex_words: int = 3 * row_words

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
    def load(units: wp.uint64, block: int, lane: int, k: int, axis: int):
        return load_triangles(units, block + vertex_words * k + row_words * axis, lane)

    @wp.func
    def edge(units: wp.uint64, block: int, lane: int, k: int, axis: int):
        return load_triangles(units, block + vertex_words * k + row_words * axis, lane)

    @wp.func
    def edge_at(units: wp.uint64, at: int, v0: real):
        return load_number(units, at)

    @wp.func
    def used(units: wp.uint64, block: int, lane: int, passed: wp.uint32):
        return passed

    return _block(block_words, block_at, stride, vertex_at, prim_at, load, edge, edge_at, used)


def compressed_block(lanes: SimpleNamespace) -> SimpleNamespace:
    """Up to four triangles over six or eight vertices; the header says which lanes are used."""
    length: int = lanes.triangles_length
    vector = lanes.triangles

    @wp.func
    def header(units: wp.uint64, at: int):
        return wp.cast(load_float(units, at), wp.uint32)

    @wp.func
    def corner_numbers(units: wp.uint64, block: int, k: int):
        """The vertex numbers of corner k in the low bits: two corners share a word of the header."""
        return header(units, block + k // 2) >> wp.uint32(CORNER_BITS * (k % 2))

    @wp.func
    def stride(units: wp.uint64, block: int):
        return int(header(units, block + 1) >> wp.uint32(VERTICES_SHIFT))

    @wp.func
    def block_at(units: wp.uint64, begin: int, i: int):
        at = int(begin)
        for _ in range(i):  # rarely more than once
            at += 4 * stride(units, at)  # one unit of eight words per two vertices
        return at

    @wp.func
    def vertex_at(units: wp.uint64, block: int, k: int, j: int):
        number = corner_numbers(units, block, k) >> wp.uint32(NUMBER_BITS * j)
        return block + HEADER_WORDS + int(number & wp.uint32(7))

    @wp.func
    def prim_at(units: wp.uint64, block: int, j: int):
        return block + HEADER_WORDS + 3 * stride(units, block) + j

    @wp.func_native(PICK_4 if length == 4 else PICK_1)
    def pick(units: wp.uint64, row: int, numbers: wp.uint32, lane: int) -> vector: ...

    @wp.func
    def load(units: wp.uint64, block: int, lane: int, k: int, axis: int):
        row = block + HEADER_WORDS + axis * stride(units, block)
        return pick(units, row, corner_numbers(units, block, k), lane)

    @wp.func
    def edge(units: wp.uint64, block: int, lane: int, k: int, axis: int):
        return load(units, block, lane, k, axis) - load(units, block, lane, 0, axis)

    @wp.func
    def edge_at(units: wp.uint64, at: int, v0: float):
        return load_float(units, at) - v0

    @wp.func
    def used(units: wp.uint64, block: int, lane: int, passed: wp.uint32):
        used_lanes = (header(units, block + 1) >> wp.uint32(USED_SHIFT)) & wp.uint32(15)
        return passed & (used_lanes >> wp.uint32(wp.where(length == 1, lane & 3, 0)))

    return _block(LEAST_COMPRESSED_WORDS, block_at, stride, vertex_at, prim_at, load, edge, edge_at, used)


def _block(least_words: int, *functions: wp.Function) -> SimpleNamespace:
    names = ("block_at", "stride", "vertex_at", "prim_at", "load", "edge", "edge_at", "used")
    found = {name: without_gradient(function) for name, function in zip(names, functions, strict=True)}
    return SimpleNamespace(least_words=least_words, **found)


def block_form(lanes: SimpleNamespace, nodes: str, precision: str) -> SimpleNamespace:
    """The block form of a tree with this node form: blocks of float64 are never compressed."""
    if nodes == "compressed" and precision == "float32":
        return compressed_block(lanes)
    return plain_block(lanes, precision)
