"""The forms of a triangle block, as layout.h and compressed.h: where its corners and prims stand.

A vertex is found at the word `vertex_at`, its axes `stride` words apart. `block_at` is the i-th block of a
leaf. `load` reads a vertex of the thread's triangles, `edge` and `edge_at` what lies between the first and
another: `fast` trees store that, but in compressed blocks.
"""

from types import SimpleNamespace

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.lanes.lanes import load_float, without_gradient
from wive.warp_kernels.lanes.native import PICK_1, PICK_4
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.tree.handle import BLOCK_WORDS, LEAST_COMPRESSED_WORDS, PRIM_ROW


def plain_block(lanes: SimpleNamespace, precision: str) -> SimpleNamespace:
    """Four triangles side by side; NaN fails every test in the lanes that are not used."""
    load_triangles = lanes.load_triangles
    numbers = PRECISIONS[precision]
    real, load_number = numbers.real, numbers.load
    words: int = numbers.words
    block_words: int = BLOCK_WORDS * words

    @wp.func
    def block_at(units: wp.uint64, begin: int, i: int):
        return begin + block_words * i

    @wp.func
    def stride(units: wp.uint64, block: int):
        return 4 * words

    @wp.func
    def vertex_at(units: wp.uint64, block: int, k: int, j: int):
        return block + 12 * words * k + words * j

    @wp.func
    def prim_at(units: wp.uint64, block: int, j: int):
        return block + wp.static(PRIM_ROW) * words + j

    @wp.func
    def load(units: wp.uint64, block: int, lane: int, k: int, axis: int):
        return load_triangles(units, block + 12 * words * k + 4 * words * axis, lane)

    @wp.func
    def edge(units: wp.uint64, block: int, lane: int, k: int, axis: int):
        return load_triangles(units, block + 12 * words * k + 4 * words * axis, lane)

    @wp.func
    def edge_at(units: wp.uint64, at: int, v0: real):
        return load_number(units, at)

    @wp.func
    def used(units: wp.uint64, block: int, lane: int, passed: wp.uint32):
        return passed

    return _block(block_words, block_at, stride, vertex_at, prim_at, load, edge, edge_at, used)


def compressed_block(lanes: SimpleNamespace) -> SimpleNamespace:
    """Up to four triangles over six or eight vertices; a word says which lanes are used."""
    length: int = lanes.triangles_length
    vector = lanes.triangles

    @wp.func
    def header(units: wp.uint64, at: int):
        return wp.cast(load_float(units, at), wp.uint32)

    @wp.func
    def stride(units: wp.uint64, block: int):
        return int(header(units, block + 1) >> wp.uint32(20))

    @wp.func
    def block_at(units: wp.uint64, begin: int, i: int):
        at = int(begin)
        for _ in range(i):  # rarely more than once
            at += 4 * stride(units, at)
        return at

    @wp.func
    def vertex_at(units: wp.uint64, block: int, k: int, j: int):
        number = header(units, block + k // 2) >> wp.uint32(16 * (k % 2) + 4 * j)
        return block + 2 + int(number & wp.uint32(7))

    @wp.func
    def prim_at(units: wp.uint64, block: int, j: int):
        return block + 2 + 3 * stride(units, block) + j

    @wp.func_native(PICK_4 if length == 4 else PICK_1)
    def pick(units: wp.uint64, row: int, numbers: wp.uint32, lane: int) -> vector: ...

    @wp.func
    def load(units: wp.uint64, block: int, lane: int, k: int, axis: int):
        numbers = header(units, block + k // 2) >> wp.uint32(16 * (k % 2))
        return pick(units, block + 2 + axis * stride(units, block), numbers, lane)

    @wp.func
    def edge(units: wp.uint64, block: int, lane: int, k: int, axis: int):
        return load(units, block, lane, k, axis) - load(units, block, lane, 0, axis)

    @wp.func
    def edge_at(units: wp.uint64, at: int, v0: float):
        return load_float(units, at) - v0

    @wp.func
    def used(units: wp.uint64, block: int, lane: int, passed: wp.uint32):
        lanes = (header(units, block + 1) >> wp.uint32(16)) & wp.uint32(15)
        return passed & (lanes >> wp.uint32(wp.where(length == 1, lane & 3, 0)))

    return _block(LEAST_COMPRESSED_WORDS, block_at, stride, vertex_at, prim_at, load, edge, edge_at, used)


def _block(least_words: int, *functions: wp.Function) -> SimpleNamespace:
    names = ("block_at", "stride", "vertex_at", "prim_at", "load", "edge", "edge_at", "used")
    found = {name: without_gradient(function) for name, function in zip(names, functions, strict=True)}
    return SimpleNamespace(least_words=least_words, **found)


def block_form(lanes: SimpleNamespace, nodes: str, precision: str) -> SimpleNamespace:
    """The blocks of a tree with this form of nodes: those of float64 are never compressed."""
    if nodes == "compressed" and precision == "float32":
        return compressed_block(lanes)
    return plain_block(lanes, precision)
