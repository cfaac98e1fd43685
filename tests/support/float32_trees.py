"""float32 trees read word by word, as cpu/core/layout.h describes them."""

import numpy as np

from wive import _cpu

LEAF = np.uint32(0x80000000)
EMPTY_PLANE = 1e24


def planes(bvh: _cpu.Bvh) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corners of every lane's box (m,8,3), in float64 and in the mesh's own coordinates."""
    rows = bvh.nodes[:, :6].view(np.float32).astype(np.float64) + np.repeat(bvh.center, 2)[:, None]
    return rows[:, 0::2].transpose(0, 2, 1), rows[:, 1::2].transpose(0, 2, 1)


def used_lanes(bvh: _cpu.Bvh) -> np.ndarray:
    return bvh.nodes[:, 0].view(np.float32) < EMPTY_PLANE


def walk(bvh: _cpu.Bvh) -> list[tuple[int, int, int, int]]:
    """Every used lane: (node, lane, depth, child reference)."""
    lanes, todo, found = used_lanes(bvh), [(0, 1)], []
    while todo:
        node, depth = todo.pop()
        for lane in np.flatnonzero(lanes[node]):
            child = int(bvh.nodes[node, 6, lane])
            found.append((node, int(lane), depth, child))
            if child < LEAF:
                todo.append(
                    (child // 64, depth + 1)
                )  # a node is eight units, references count units times eight
    return found


def leaf_blocks(bvh: _cpu.Bvh, child: int) -> range:
    first = ((child & 0x7FFFFFF8) // 8 - 8 * len(bvh.nodes)) // 5
    return range(first, first + (child & 7) + 1)
