"""What drawings of the small tree have in common: the world from above, boxes, cells, ray and stack."""

from __future__ import annotations

import numpy as np
from layout import CHILDREN, EDGE, FAINT
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Rectangle
from small_tree import Node, Tree, segments

RAY = (-5.3, -0.9), 25.0  # start, degrees from the x axis
HIT, MISS, LIGHT = "#c2410c", "#9aa4ae", "#e4e8ec"
LOW, HIGH = (-5.6, -3.2), (5.3, 3.4)  # of the world
ARROW = {"arrowstyle": "-|>", "mutation_scale": 14, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}


def world(ax: Axes) -> None:
    """The segments from above."""
    for ends in segments():
        ax.plot(*ends.T, color=EDGE, linewidth=1.1, solid_capstyle="round", zorder=3)
    ax.set_xlim(LOW[0], HIGH[0])
    ax.set_ylim(LOW[1], HIGH[1])
    ax.set_aspect("equal")
    ax.axis("off")


def box(
    ax: Axes, node: Node, slot: int, color: str, label: str, fill: str = "none", width: float = 1.4
) -> None:
    """One child's box and its label."""
    low, size = node.low[slot][:2], (node.high[slot] - node.low[slot])[:2]
    ax.add_patch(Rectangle(low, *size, facecolor=fill, edgecolor=color, linewidth=width, zorder=2, alpha=0.9))
    place = low[0] + 0.08, low[1] + size[1] - 0.08
    ax.text(*place, label, color=color, size=10.5, weight="bold", va="top", zorder=4)


def cell(
    ax: Axes, x: float, y: float, text: str, color: str = "white", edge: str = EDGE, ink: str = EDGE
) -> None:
    """A cell of one lane, centred at x, y."""
    ax.add_patch(Rectangle((x - 0.48, y - 0.36), 0.96, 0.72, facecolor=color, edgecolor=edge, linewidth=0.9))
    ax.text(x, y, text, ha="center", va="center", size=11, color=ink)


def draw_ray(ax: Axes, until: float) -> None:
    """The ray up to t = until."""
    start, degrees = RAY
    turn = np.radians(degrees)
    end = np.add(start, until * np.array([np.cos(turn), np.sin(turn)]))
    ax.add_patch(FancyArrowPatch(start, end, color=HIT, zorder=5, **ARROW))
    ax.plot(*start, "o", color=HIT, markersize=5, zorder=5)


def draw_stack(
    ax: Axes,
    tree: Tree,
    stack: list[tuple[float, int]],
    x: float,
    y: float,
    tmax: float,
    spread: float = 1.08,
) -> None:
    """The stack from left to right, the next one first, with entry distances; beyond tmax it is pale."""
    for i, (entry, reference) in enumerate(reversed(stack)):
        dropped = entry > tmax
        ink = MISS if dropped else EDGE
        cell(ax, x + i * spread, y, tree.name(reference), "white" if dropped else CHILDREN, ink, ink)
        ax.text(x + i * spread, y - 0.46, f"{entry:.2f}", ha="center", va="top", size=9, color=ink)
    if not stack:
        ax.text(x - 0.45, y, "empty", size=10.5, va="center", color=FAINT)
