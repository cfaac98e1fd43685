"""Compressed trees read word by word, as cpu/core/compressed.h describes them, and hard meshes for them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from support.meshes import TRIANGLE, soup, sphere
from wive import _cpu

Mesh = tuple[np.ndarray, np.ndarray]

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

    Exact in float64 if origin and step are within 2**20 of each other.
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
    """(m,8) order lanes, three bits per octant."""
    words = np.ascontiguousarray(bvh.nodes).reshape(len(bvh.nodes), NODE_WORDS)
    lanes = np.ascontiguousarray(words[:, 18:24]).view(np.uint8).reshape(-1, 8, 3).astype(np.uint32)
    return lanes[..., 0] | lanes[..., 1] << np.uint32(8) | lanes[..., 2] << np.uint32(16)


def walk(bvh: _cpu.Bvh) -> Iterator[tuple[int, int, int]]:
    """Every used lane: (node, lane, child reference)."""
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
    """The triangle numbers in all leaves, sorted."""
    leaves = [reference for _, _, reference in walk(bvh) if reference >= LEAF]
    return sorted(prim for leaf in leaves for block in blocks(bvh, leaf) for prim in block.prims)


def flat(mesh: Mesh, axis: int) -> Mesh:
    vertices = mesh[0].copy()
    vertices[:, axis] = 0
    return vertices, mesh[1]


def scaled(mesh: Mesh, scale: float) -> Mesh:
    return (mesh[0].astype(np.float64) * scale).astype(np.float32), mesh[1]


def strewn(count: int) -> Mesh:
    """Triangles whose sizes and places differ by many orders of magnitude."""
    random = np.random.default_rng(12)
    corners = random.standard_normal((count, 1, 3)) * 10.0 ** random.uniform(-12, 6, (count, 1, 1))
    corners = corners + random.standard_normal((count, 3, 3)) * 10.0 ** random.uniform(-9, 3, (count, 1, 1))
    return corners.astype(np.float32).reshape(-1, 3), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


MESHES: dict[str, Callable[[], Mesh]] = {
    "one triangle": lambda: TRIANGLE,
    "two triangles": lambda: soup(2, seed=1),
    "sphere": lambda: sphere(4),
    "soup": lambda: soup(2000, seed=2),
    "far away": lambda: (sphere(3)[0] + np.float32([148376, 1234, -223423]), sphere(3)[1]),
    "flat across x": lambda: flat(soup(500, seed=3), 0),
    "flat across z": lambda: flat(soup(500, seed=4), 2),
    "a flat triangle": lambda: (np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.int32([[0, 1, 2]])),
    "tiny": lambda: scaled(soup(500, seed=5), 1e-30),
    "tinier": lambda: scaled(soup(500, seed=5), 1e-38),
    "huge": lambda: scaled(soup(500, seed=6), 1e17),
    "strewn": lambda: strewn(2000),
    "all alike": lambda: (
        np.tile(np.eye(3, dtype=np.float32), (1000, 1)),
        np.arange(3000, dtype=np.int32).reshape(-1, 3),
    ),
    "signed zeros": lambda: (
        np.float32([[0.0, 0, 0], [-0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0]]),
        np.int32([[0, 2, 3], [1, 4, 2]]),
    ),
    "all degenerate": lambda: (sphere(1)[0], np.ascontiguousarray(sphere(1)[1][:, [0, 1, 1]])),
    "empty": lambda: (np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)),
}
