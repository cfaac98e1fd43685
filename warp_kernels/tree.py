"""The tree on a Warp device."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from wive import _cpu
from wive.warp_kernels.handle import (
    ACCURACIES,
    CORRUPT,
    HANDLES,
    NODE_WIDTH,
    STACK_TOO_SMALL,
    WORD_MASK,
    WRONG_ACCURACY,
)
from wive.warp_kernels.quiet import hush
from wive.warp_kernels.ranks import invert_orders

MAX_DEPTH = 64  # cpu/layout.h
STACK_SIZES = (32, 64, 96, 128, 256, 512)  # kernels are compiled for the least that a tree can do with

_REASONS = {
    CORRUPT: "a traversal left the tree or did not end: the tree's memory was overwritten",
    STACK_TOO_SMALL: "the tree is too deep for closest_hit and any_hit; use launch_closest and launch_any",
    WRONG_ACCURACY: "the handle of a tree was given to a kernel that takes that of another accuracy",
}


class CorruptTreeError(RuntimeError):
    """A kernel could not traverse the tree; what it wrote is worthless."""


@dataclass(frozen=True)
class Tree:
    """A tree on a Warp device, made by `upload`.

    `handle` is what kernels take, by accuracy a `Bvh`, `FastBvh` or `ExactBvh`. `stack` is the number of
    stack entries its kernels are compiled for. `memory` counts bytes on the device.
    """

    device: wp.Device
    accuracy: str
    handle: Any
    units: wp.array[Any]
    error: wp.array[Any]
    stack: int

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
    wp.launch(invert_orders, dim=len(nodes), inputs=[units], device=place, block_dim=128, record_tape=False)

    handle = HANDLES[bvh.accuracy]()
    handle.units = units
    handle.error = error
    handle.center = wp.vec3(*bvh.center.tolist())
    handle.extent = wp.vec3(*bvh.extent.tolist())
    handle.step_limit = (
        len(bvh.units) // 5 + 1
    )  # a node is eight units, a leaf at least five, and none is met twice
    handle.stack = needed
    handle.accuracy = ACCURACIES.index(bvh.accuracy)
    stack = next(size for size in STACK_SIZES if size >= needed)
    return Tree(device=place, accuracy=bvh.accuracy, handle=handle, units=units, error=error, stack=stack)


def check(tree: Tree) -> None:
    """Wait for the device and raise CorruptTreeError where a kernel could not traverse the tree."""
    reason = int(tree.error.numpy()[0])
    if reason:
        raise CorruptTreeError(f"tree on {tree.device}: {_REASONS[reason]}")


def stack_entries(nodes: NDArray[np.uint32]) -> int:
    """The most entries that a traversal of nodes (m,8,8) can have on its stack, and room for eight more.

    A visit pushes at most all children, of which one is taken before the next visit. Below them is the entry
    that ends the traversal.
    """
    planes = nodes.view(np.float32)
    level, held, most = np.zeros(1, np.int64), np.zeros(1, np.int64), 0
    for _ in range(MAX_DEPTH):
        filled = planes[level, 0] <= planes[level, 1]
        held = held + filled.sum(axis=1)
        most = max(most, int(held.max()))
        child = nodes[level, 6]
        inner = filled & (child >> 31 == 0)
        held = np.repeat(held - 1, inner.sum(axis=1))
        level = (child[inner] & WORD_MASK).astype(np.int64) // (NODE_WIDTH * 8)
        if len(level) == 0:
            return most + 1 + NODE_WIDTH
    raise CorruptTreeError(f"the tree is deeper than {MAX_DEPTH} nodes")
