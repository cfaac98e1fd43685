"""A tree on a Warp device: its upload, and the check that kernels could traverse it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from wive import _cpu
from wive.warp_kernels.lanes.layout import (
    BLOCK_WORDS,
    CHILD_ROW,
    COMPRESSED_CHILD_ROW,
    COMPRESSED_NODE_WORDS,
    LEAST_COMPRESSED_WORDS,
    MAX_DEPTH,
    NODE_WIDTH,
    NODE_WORDS,
    UNIT_WORDS,
    WORD_MASK,
)
from wive.warp_kernels.tree.handle import (
    ACCURACIES,
    COMPRESSED,
    CORRUPT,
    FLOAT64,
    HANDLES,
    STACK_TOO_SMALL,
    WRONG_ACCURACY,
)
from wive.warp_kernels.tree.quiet import set_quiet
from wive.warp_kernels.tree.ranks import INVERT_ORDERS

# Kernels are compiled for the smallest of these sizes that the tree can't overflow.
STACK_SIZES = (32, 64, 96, 128, 256, 512)

_REASONS = {
    CORRUPT: "a traversal left the tree or did not end: the tree's memory was overwritten",
    STACK_TOO_SMALL: "the tree is too deep for closest_hit and any_hit; use launch_closest and launch_any",
    WRONG_ACCURACY: "the handle of a tree was given to a kernel that takes that of another accuracy",
    COMPRESSED: "closest_hit and any_hit take trees with nodes 'float32'; use launch_closest and launch_any",
    FLOAT64: "closest_hit and any_hit take trees of float32 vertices; use launch_closest and launch_any, "
    "or make the scene with vertices.astype(np.float32)",
}


class CorruptTreeError(RuntimeError):
    """A kernel could not traverse the tree; its outputs are meaningless."""


@dataclass(frozen=True)
class Tree:
    """A tree on a Warp device, made by `upload`.

    `handle` is what kernels take: a `Bvh`, `FastBvh` or `ExactBvh`, depending on the accuracy. `stack` is the
    stack size that its kernels are compiled for, `nodes` is "float32" or "compressed", `precision` "float32"
    or "float64".
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

    The copy differs in one row of each node: `order`, which says which child comes i-th, is turned into the
    rank of each child, so that a lane finds its place without reading another lane.
    """
    set_quiet()
    place = wp.get_device(device)
    nodes = bvh.nodes
    units: wp.array[Any] = wp.array(bvh.units.reshape(-1).view(np.float32), dtype=wp.float32, device=place)
    error = wp.zeros(1, dtype=wp.int32, device=place)
    needed = stack_size(nodes)
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
    compressed, double = bvh.node_form == "compressed", bvh.precision == "float64"
    # A traversal meets no node and no leaf twice.
    node_words = COMPRESSED_NODE_WORDS if compressed else NODE_WORDS
    block_words = 2 * BLOCK_WORDS if double else LEAST_COMPRESSED_WORDS if compressed else BLOCK_WORDS
    handle.step_limit = len(bvh.units) // (min(node_words, block_words) // UNIT_WORDS) + 1
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
    """Wait for the device and raise CorruptTreeError if a kernel could not traverse the tree."""
    reason = int(tree.error.numpy()[0])
    if reason:
        raise CorruptTreeError(f"tree on {tree.device}: {_REASONS[reason]}")


def stack_size(nodes: NDArray[np.uint32]) -> int:
    """The most children that a traversal can have on its stack, and room for eight more.

    nodes: (m,8,8), or (m,4,8) compressed.

    A visit pushes at most all children of a node; one of them is popped before the next visit. Below them is
    the entry that ends the traversal.
    """
    if nodes.shape[1] == 8:
        node_words, children, planes = NODE_WORDS, nodes[:, CHILD_ROW // 8], nodes.view(np.float32)
        used = planes[:, 0] <= planes[:, 1]
    else:
        node_words, children = COMPRESSED_NODE_WORDS, nodes[:, COMPRESSED_CHILD_ROW // 8]
        used = children != 0xFFFFFFFF
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
