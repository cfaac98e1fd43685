"""The tree on a Warp device."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from wive import _cpu
from wive.warp_kernels.tree.handle import (
    ACCURACIES,
    BLOCK_WORDS,
    COMPRESSED,
    COMPRESSED_NODE_WORDS,
    CORRUPT,
    FLOAT64,
    HANDLES,
    LEAST_COMPRESSED_WORDS,
    NODE_WIDTH,
    NODE_WORDS,
    STACK_TOO_SMALL,
    WORD_MASK,
    WRONG_ACCURACY,
)
from wive.warp_kernels.tree.quiet import hush
from wive.warp_kernels.tree.ranks import INVERT_ORDERS

MAX_DEPTH = 64  # cpu/core/layout.h
STACK_SIZES = (32, 64, 96, 128, 256, 512)  # kernels are compiled for the least that a tree can do with

_REASONS = {
    CORRUPT: "a traversal left the tree or did not end: the tree's memory was overwritten",
    STACK_TOO_SMALL: "the tree is too deep for closest_hit and any_hit; use launch_closest and launch_any",
    WRONG_ACCURACY: "the handle of a tree was given to a kernel that takes that of another accuracy",
    COMPRESSED: "closest_hit and any_hit take trees with nodes 'float32'; use launch_closest and launch_any",
    FLOAT64: "closest_hit and any_hit take trees of float32 vertices; use launch_closest and launch_any, "
    "or make the scene with vertices.astype(np.float32)",
}


class CorruptTreeError(RuntimeError):
    """A kernel could not traverse the tree; what it wrote is worthless."""


@dataclass(frozen=True)
class Tree:
    """A tree on a Warp device, made by `upload`.

    `handle` is what kernels take, by accuracy a `Bvh`, `FastBvh` or `ExactBvh`. `stack` is the number of
    stack entries its kernels are compiled for, `nodes` is "float32" or "compressed", `precision` "float32" or
    "float64". `memory` counts bytes on the device.
    """

    device: wp.Device
    accuracy: str
    handle: Any
    units: wp.array[Any]
    error: wp.array[Any]
    stack: int
    nodes: str = "float32"
    precision: str = "float32"

    @property
    def memory(self) -> int:
        """Bytes of nodes and triangle blocks on the device."""
        return int(self.units.size) * 4


def upload(bvh: _cpu.Bvh, device: wp.DeviceLike = None) -> Tree:
    """Copy the tree to a Warp device ("cpu", "cuda:0", ...; None is Warp's current device).

    The copy differs in one row of each node: `order` says which child comes i-th, and is turned into the rank
    of each child, so that a lane knows its place without asking another.
    """
    hush()
    place = wp.get_device(device)
    nodes = bvh.nodes
    units: wp.array[Any] = wp.array(bvh.units.reshape(-1).view(np.float32), dtype=wp.float32, device=place)
    error = wp.zeros(1, dtype=wp.int32, device=place)
    needed = stack_entries(nodes)
    wp.launch(
        INVERT_ORDERS[bvh.node_form],
        dim=len(nodes),
        inputs=[units],
        device=place,
        block_dim=128,
        record_tape=False,
    )

    handle = HANDLES[bvh.accuracy]()
    handle.units = units
    handle.error = error
    handle.center = wp.vec3(*bvh.center.tolist())
    handle.extent = wp.vec3(*bvh.extent.tolist())
    compressed, double = bvh.node_form == "compressed", bvh.precision == "float64"
    # In units, no node is met twice, nor is a leaf.
    node = (COMPRESSED_NODE_WORDS if compressed else NODE_WORDS) // 8
    block = BLOCK_WORDS // 4 if double else (LEAST_COMPRESSED_WORDS if compressed else BLOCK_WORDS) // 8
    handle.step_limit = len(bvh.units) // min(node, block) + 1
    handle.stack = needed
    handle.accuracy = ACCURACIES.index(bvh.accuracy)
    handle.refusal = FLOAT64 if double else COMPRESSED if compressed else 0
    stack = next(size for size in STACK_SIZES if size >= needed)
    return Tree(
        device=place,
        accuracy=bvh.accuracy,
        handle=handle,
        units=units,
        error=error,
        stack=stack,
        nodes=bvh.node_form,
        precision=bvh.precision,
    )


def check(tree: Tree) -> None:
    """Wait for the device and raise CorruptTreeError where a kernel could not traverse the tree."""
    reason = int(tree.error.numpy()[0])
    if reason:
        raise CorruptTreeError(f"tree on {tree.device}: {_REASONS[reason]}")


def stack_entries(nodes: NDArray[np.uint32]) -> int:
    """The most entries that a traversal can have on its stack, and room for eight more.

    nodes: (m,8,8), or (m,4,8) compressed.

    A visit pushes at most all children, of which one is taken before the next visit. Below them is the entry
    that ends the traversal.
    """
    if nodes.shape[1] == 8:
        children, planes = nodes[:, 6], nodes.view(np.float32)
        used = planes[:, 0] <= planes[:, 1]
    else:
        children = nodes[:, 3]
        used = children != 0xFFFFFFFF
    node_words = NODE_WORDS if nodes.shape[1] == 8 else COMPRESSED_NODE_WORDS
    level, held, most = np.zeros(1, np.int64), np.zeros(1, np.int64), 0
    for _ in range(MAX_DEPTH):
        filled = used[level]
        held = held + filled.sum(axis=1)
        most = max(most, int(held.max()))
        child = children[level]
        inner = filled & (child >> 31 == 0)
        held = np.repeat(held - 1, inner.sum(axis=1))
        level = (child[inner] & WORD_MASK).astype(np.int64) // node_words
        if len(level) == 0:
            return most + 1 + NODE_WIDTH
    raise CorruptTreeError(f"the tree is deeper than {MAX_DEPTH} nodes")
