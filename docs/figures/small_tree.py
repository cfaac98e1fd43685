"""A small real tree, seen from above, and a walk of one ray through it: what the other drawings show.

The mesh is upright triangles on the segments of closed curves in the plane z = 0. From above, boxes are
rectangles, and rays just above the plane meet the segments. `wive` builds the tree; nodes are decoded by
cpu/core/layout.h, and `walk` takes the steps of `visit` in cpu/traverse/traversal.h.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import wive

LEAF = 0x80000000
HEIGHT = 0.02  # of the rays above the ground
CURVES = (  # middle, radius, corners, how deep the waves of the outline are, how many
    ((-3.1, 1.5), 1.25, 30, 0.16, 5),
    ((0.3, 2.2), 0.95, 18, 0.0, 0),
    ((3.3, 1.7), 1.15, 26, 0.22, 3),
    ((-2.2, -1.8), 1.1, 22, 0.0, 0),
    ((1.0, -1.2), 1.3, 34, 0.14, 7),
    ((4.2, -1.7), 0.75, 14, 0.0, 0),
)


def segments() -> np.ndarray:
    """(s,2,2) the ends of the segments from above."""
    parts = []
    for (x, y), radius, corners, depth, waves in CURVES:
        turn = np.arange(corners) * 2 * np.pi / corners + 0.1
        away = radius * (1 + depth * np.cos(waves * turn))
        points = np.stack([x + away * np.cos(turn), y + 0.8 * away * np.sin(turn)], axis=1)
        parts.append(np.stack([points, np.roll(points, -1, axis=0)], axis=1))
    return np.concatenate(parts)


def scene_over(ends: np.ndarray) -> wive.Scene:
    """A scene of one upright triangle per segment, its tip far above the middle."""
    tips = np.concatenate([ends.mean(axis=1), np.full((len(ends), 1), 6.0)], axis=1)
    feet = np.concatenate([ends, np.zeros((*ends.shape[:2], 1))], axis=2)
    vertices = np.concatenate([feet, tips[:, None]], axis=1).reshape(-1, 3)
    return wive.Scene(vertices.astype(np.float32), np.arange(len(vertices)).reshape(-1, 3))


@dataclass
class Node:
    """One inner node; arrays are by slot."""

    number: int
    low: np.ndarray  # (8,3)
    high: np.ndarray
    child: np.ndarray  # (8,) references
    order: np.ndarray  # (8,8) slots by octant, from front to back

    @property
    def used(self) -> np.ndarray:
        """The slots that hold a child."""
        return np.flatnonzero(self.low[:, 0] <= self.high[:, 0])


class Tree:
    """The nodes and blocks of a scene, decoded."""

    def __init__(self, scene: wive.Scene) -> None:
        """Decode all nodes."""
        bvh = scene._tracer.bvh
        self.center = np.array(bvh.center, np.float64)
        self.nodes = [self._node(i, rows, bvh) for i, rows in enumerate(bvh.nodes)]
        self.first_block = 8 * len(self.nodes)
        self.prims = bvh.blocks[:, 9].view(np.int32)

    def _node(self, number: int, rows: np.ndarray, bvh: object) -> Node:
        planes = rows[:6].view(np.float32).astype(np.float64)
        shifts = 4 * np.arange(8)[:, None]
        return Node(
            number,
            planes[0::2].T + self.center,
            planes[1::2].T + self.center,
            rows[6],
            (rows[7] >> shifts) & 7,
        )

    def node(self, reference: int) -> Node:
        """The inner node that a reference leads to."""
        return self.nodes[int(reference) >> 3 >> 3]

    def triangles(self, reference: int) -> list[int]:
        """The triangles of a leaf."""
        first = ((int(reference) & ~LEAF) >> 3) - self.first_block
        blocks = self.prims[first // 5 : first // 5 + (int(reference) & 7) + 1]
        return [int(prim) for prim in blocks.ravel() if prim >= 0]

    def name(self, reference: int) -> str:
        """How drawings call a node or a leaf: A, B, ..., and a, b, ..."""
        if not int(reference) & LEAF:
            return chr(ord("A") + self.node(reference).number)
        leaves = sorted(int(c) for node in self.nodes for c in node.child[node.used] if c & LEAF)
        return f"{leaves.index(int(reference)) + 1}"


def treelet(node: Node) -> tuple | int:
    """The binary treelet that the node's orders come from: (axis, low side, high side), or a slot.

    A split puts its low side in front for all octants that are positive on its axis, else behind.
    """

    def split(slots: list[int]) -> tuple | int:
        if len(slots) == 1:
            return slots[0]
        orders = [[int(s) for s in node.order[octant] if s in slots] for octant in range(8)]
        for k in range(1, len(slots)):
            low = set(orders[0][:k])
            first = [set(order[:k]) == low for order in orders]
            last = [set(order[-k:]) == low for order in orders]
            for axis in range(3):
                if all(first[o] if not o >> axis & 1 else last[o] for o in range(8)):
                    high = [s for s in orders[0] if s not in low]
                    return axis, split([s for s in orders[0] if s in low]), split(high)
        raise ValueError("these orders are not those of a treelet")

    return split([int(s) for s in node.order[0] if s in node.used])


@dataclass
class Step:
    """What one step of a walk did."""

    reference: int  # the node or leaf visited; its entry distance
    entry: float
    tmax: float  # before the step
    near: np.ndarray | None = None  # (8,) entry distances by slot
    far: np.ndarray | None = None
    hit: list[int] = field(default_factory=list)  # slots that were hit, from front to back
    tested: list[int] = field(default_factory=list)  # triangles
    found: int = -1  # the triangle that became the best
    stack: list[tuple[float, int]] = field(default_factory=list)  # after the step, the top last


def slabs(
    node: Node, origin: np.ndarray, direction: np.ndarray, tmax: float
) -> tuple[np.ndarray, np.ndarray]:
    """(8,) entry and exit distances of a ray and the node's boxes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        reciprocal = 1 / np.where(np.abs(direction) < 1e-9, 1e-9, direction)
        a, b = (node.low - origin) * reciprocal, (node.high - origin) * reciprocal
    return np.minimum(a, b).max(axis=1).clip(0), np.minimum(np.maximum(a, b).min(axis=1), tmax)


def walk(tree: Tree, scene: wive.Scene, origin: np.ndarray, direction: np.ndarray) -> list[Step]:
    """The steps of a ray to its closest hit."""
    octant = int((direction < 0) @ [1, 2, 4])
    stack, tmax, steps = [(0.0, 0)], np.inf, []
    while stack:
        entry, reference = stack.pop()
        if entry > tmax:
            continue
        step = Step(reference, entry, tmax)
        if reference & LEAF:
            step.tested = tree.triangles(reference)
            corners = scene.faces[step.tested].ravel()
            part = wive.Scene(scene.vertices[corners], np.arange(len(corners)).reshape(-1, 3))
            hits = part.intersect(origin, direction, tmax=tmax)
            if hits.mask[0]:
                tmax, step.found = float(hits.t[0]), step.tested[hits.prim[0]]
        else:
            node = tree.node(reference)
            step.near, step.far = slabs(node, origin, direction, tmax)  # (B)
            in_order = [int(s) for s in node.order[octant] if s in node.used]  # (A)
            step.hit = [s for s in in_order if step.near[s] <= step.far[s]]  # (C)
            stack += [(float(step.near[s]), int(node.child[s])) for s in reversed(step.hit)]  # (D)
        step.stack = list(stack)
        steps.append(step)
    return steps


def ray(start: tuple[float, float], degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Origin and direction of a ray in the plane, by its start and its angle from the x axis."""
    turn = np.radians(degrees)
    return np.array([*start, HEIGHT]), np.array([np.cos(turn), np.sin(turn), 0.0])
