"""Compressed trees read word by word, as cpu/compressed.h describes them, and every tree's way down."""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from wive import _cpu

LEAF = 0x80000000
NO_CHILD = 0xFFFFFFFF
NODE_WORDS = 32


@dataclass(frozen=True)
class Block:
    """A block's triangles: corners (lanes,3,3) float32, and their numbers."""

    corners: np.ndarray
    prims: list[int]
    vertices: int
    words: int


def decode_planes(bvh: _cpu.Bvh) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners of every lane's box (m,8,3), relative to the centre.

    Exact in float64 wherever origin and step are within 2**20 of each other.
    """
    words = np.ascontiguousarray(bvh.nodes).reshape(len(bvh.nodes), NODE_WORDS)
    header = words[:, :6].view(np.float32).astype(np.float64)
    rows = np.ascontiguousarray(words[:, 6:18]).view(np.uint8).reshape(-1, 3, 2, 8)
    planes = header[:, :3, None, None] + header[:, 3:, None, None] * rows
    return planes[:, :, 0].transpose(0, 2, 1), planes[:, :, 1].transpose(0, 2, 1)


def exact_box(bvh: _cpu.Bvh, node: int, lane: int) -> tuple[list[Fraction], list[Fraction]]:
    """Lower and upper corner of one box in exact arithmetic, in the mesh's own coordinates."""
    words = np.ascontiguousarray(bvh.nodes[node]).reshape(NODE_WORDS)
    header = [Fraction(float(x)) for x in words[:6].view(np.float32)]
    rows = words[6:18].view(np.uint8).reshape(3, 2, 8)
    center = [Fraction(float(x)) for x in bvh.center]
    low, high = (
        [header[axis] + header[3 + axis] * int(rows[axis, side, lane]) + center[axis] for axis in range(3)]
        for side in (0, 1)
    )
    return low, high


def children(bvh: _cpu.Bvh) -> np.ndarray:
    """Child references (m,8)."""
    return bvh.nodes[:, 3]


def orders(bvh: _cpu.Bvh) -> np.ndarray:
    """(m,8) order lanes, three bits an octant."""
    words = np.ascontiguousarray(bvh.nodes).reshape(len(bvh.nodes), NODE_WORDS)
    lanes = np.ascontiguousarray(words[:, 18:24]).view(np.uint8).reshape(-1, 8, 3).astype(np.uint32)
    return lanes[..., 0] | lanes[..., 1] << np.uint32(8) | lanes[..., 2] << np.uint32(16)


def walk(bvh: _cpu.Bvh) -> Iterator[tuple[int, int, int]]:
    """Every way down: (node, lane, child reference)."""
    child = children(bvh)
    todo = [0]
    while todo:
        node = todo.pop()
        for lane in np.flatnonzero(child[node] != NO_CHILD):
            reference = int(child[node, lane])
            yield node, int(lane), reference
            if reference < LEAF:
                todo.append(reference // NODE_WORDS)


def blocks(bvh: _cpu.Bvh, reference: int) -> Iterator[Block]:
    """The blocks of the leaf that a child reference names."""
    words = np.ascontiguousarray(bvh.units).reshape(-1)
    at = reference & 0x7FFFFFF8
    for _ in range((reference & 7) + 1):
        head = int(words[at]) | int(words[at + 1]) << 32
        vertices = head >> 52
        rows = words[at + 2 : at + 2 + 3 * vertices].view(np.float32).reshape(3, vertices)
        prims = words[at + 2 + 3 * vertices : at + 6 + 3 * vertices].view(np.int32)
        lanes = [lane for lane in range(4) if head >> (48 + lane) & 1]
        assert [lane for lane in range(4) if prims[lane] >= 0] == lanes
        numbers = [[head >> (16 * k + 4 * lane) & 7 for k in range(3)] for lane in lanes]
        yield Block(rows.T[numbers], [int(prims[lane]) for lane in lanes], vertices, 4 * vertices)
        at += 4 * vertices


def all_prims(bvh: _cpu.Bvh) -> list[int]:
    """The numbers in all leaves, sorted."""
    leaves = [reference for _, _, reference in walk(bvh) if reference >= LEAF]
    return sorted(prim for leaf in leaves for block in blocks(bvh, leaf) for prim in block.prims)
