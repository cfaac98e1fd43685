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
    PADDING_WORDS,
    UNIT_WORDS,
    WORD_MASK,
)
from wive.warp_kernels.tree.handle import CORRUPTION, HANDLES, KINDS, REFUSAL, USERS_STACK
from wive.warp_kernels.tree.quiet import launch, quiet
from wive.warp_kernels.tree.rewriting import REWRITES

# Kernels are compiled for the smallest of these sizes that the tree can't overflow.
STACK_SIZES = (32, 64, 96, 128, 256, 512)


class CorruptTreeError(RuntimeError):
    """A kernel could not traverse the tree; its outputs are meaningless."""


@dataclass(frozen=True)
class Tree:
    """A tree on a Warp device, made by `upload`.

    `batch_handle` is what `launch_closest` and its kin pass to their kernels, `stack` the stack size that
    these are compiled for, `nodes` "float32" or "compressed", `precision` "float32" or "float64".
    """

    device: wp.Device
    accuracy: str
    batch_handle: Any
    units: wp.array[Any]
    error: wp.array[Any]
    stack: int
    nodes: str = "float32"
    precision: str = "float32"

    @property
    def handle(self) -> Any:
        """What users' own kernels take: the struct in `HANDLES` of this accuracy and precision.

        Raises ValueError if `closest_hit`, `any_hit` and `count_hits` can't traverse the tree.
        """
        batches = "use launch_closest, launch_any and launch_count over batches of rays"
        if self.nodes != "float32":
            raise ValueError(
                f"kernels of your own take trees with nodes 'float32', this one has {self.nodes!r}: "
                f"make the scene with nodes='float32', or {batches}"
            )
        if self.batch_handle.stack > USERS_STACK:
            raise ValueError(
                f"kernels of your own have room for {USERS_STACK} nodes on their stack, this tree is so deep "
                f"that it needs {self.batch_handle.stack}: {batches}"
            )
        return self.batch_handle

    def __ctype__(self) -> Any:
        """Raise TypeError: Warp asks arguments of kernels for this, and kernels take the handle."""
        raise TypeError("kernels take the handle of a tree, got the Tree itself: pass scene.tree.handle")

    @property
    def memory(self) -> int:
        """Bytes of nodes and triangle blocks on the device."""
        return int(self.units.size) * 4


def upload(bvh: _cpu.Bvh, device: wp.DeviceLike = None) -> Tree:
    """Copy the tree to a Warp device ("cpu", "cuda:0", ...; None is Warp's current device).

    Waits until it is there, so that kernels on any stream may use it. The copy holds the same boxes, children
    and triangles at the same places; nodes and compressed blocks are arranged as `layout.py` says.
    """
    with quiet():
        wp.init()
    place = wp.get_device(device)
    nodes = bvh.nodes
    words = wp.array(bvh.units.reshape(-1).view(np.float32), dtype=wp.float32, device="cpu", copy=False)
    padded: wp.array[Any] = wp.zeros(len(words) + PADDING_WORDS, dtype=wp.float32, device=place)
    wp.copy(padded, words, count=len(words))
    units = padded[: len(words)]
    error = wp.zeros(2, dtype=wp.int32, device=place)
    needed = stack_size(nodes)
    for rewrite in REWRITES[bvh.node_form, bvh.precision]:
        launch(rewrite, len(nodes), [units], [], device=place, block_dim=128, record_tape=False)

    handle = HANDLES[bvh.accuracy, bvh.precision]()
    handle.units = units
    handle.error = error
    handle.center = wp.vec3(*bvh.center.tolist())
    handle.extent = wp.vec3(*bvh.extent.tolist())
    compressed, double = bvh.node_form == "compressed", bvh.precision == "float64"
    # A traversal meets no node and no leaf twice.
    node_words = COMPRESSED_NODE_WORDS if compressed else NODE_WORDS
    block_words = 2 * BLOCK_WORDS if double else LEAST_COMPRESSED_WORDS if compressed else BLOCK_WORDS
    handle.step_limit = len(bvh.units) // (min(node_words, block_words) // UNIT_WORDS) + 1
    handle.stack = needed
    handle.kind = KINDS.index((bvh.accuracy, bvh.precision))
    wp.synchronize_stream(place)
    return Tree(
        device=place,
        accuracy=bvh.accuracy,
        batch_handle=handle,
        units=units,
        error=error,
        stack=next(size for size in STACK_SIZES if size >= needed),
        nodes=bvh.node_form,
        precision=bvh.precision,
    )


def check(tree: Tree) -> None:
    """Wait for the device; raise CorruptTreeError if a kernel could not traverse the tree.

    A kernel that took the handle for that of another tree is reported once and leaves the tree as it was.
    Raises TypeError if `tree` is no tree, as a scene, whose tree is `scene.tree`.
    """
    if not isinstance(tree, Tree):
        raise TypeError(f"tree must be a wive.warp_kernels.Tree, got {type(tree).__name__}: pass scene.tree")
    check_memory(tree)
    if tree.error.numpy()[REFUSAL]:
        tree.error[REFUSAL : REFUSAL + 1].zero_()
        raise CorruptTreeError(
            f"tree on {tree.device}: a kernel that takes the handle of another kind of tree was given this "
            "one's and found nothing: annotate its argument as "
            f"wive.warp_kernels.{HANDLES[tree.accuracy, tree.precision].key}"
        )


def check_memory(tree: Tree) -> None:
    """Wait for the device; raise CorruptTreeError if a kernel found the tree overwritten."""
    if tree.error.numpy()[CORRUPTION]:
        raise CorruptTreeError(
            f"tree on {tree.device}: a traversal left the tree or did not end: "
            "the tree's memory was overwritten"
        )


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
