"""Draws registers and threads: the two forms of the slab test on AVX-512, and the two of a ray on a GPU."""

from __future__ import annotations

import matplotlib.pyplot as plt
from layout import BOXES, CHILDREN, EDGE, FAINT, ORDERS, VERTICES
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

RAYS = (BOXES, CHILDREN, ORDERS, VERTICES)  # a colour per ray


def lanes(ax: Axes, x: float, y: float, colors: list[str], texts: list[str], width: float = 1.0) -> None:
    """A row of lanes from x to the right, its lower edge at y."""
    for i, (color, text) in enumerate(zip(colors, texts, strict=True)):
        ax.add_patch(
            Rectangle((x + i * width, y), width, 0.8, facecolor=color, edgecolor=EDGE, linewidth=0.9)
        )
        ax.text(x + (i + 0.5) * width, y + 0.4, text, ha="center", va="center", size=9.5, color=EDGE)


def label(ax: Axes, x: float, y: float, text: str, bold: bool = False) -> None:
    """Text that begins at x."""
    weight = "bold" if bold else "normal"
    ax.text(
        x, y, text, size=11.5 if bold else 10.5, weight=weight, va="center", color=EDGE if bold else FAINT
    )


def canvas(height: float, low: float, high: float) -> tuple[Figure, Axes]:
    """A drawing 16.6 units wide, from low to high."""
    figure = plt.figure(figsize=(7.6, height))
    ax = figure.add_axes((0.01, 0.01, 0.98, 0.98))
    ax.set_xlim(0, 16.6)
    ax.set_ylim(low, high)
    ax.axis("off")
    return figure, ax


def draw_forms() -> Figure:
    """Full: entries and exits in two registers of eight lanes. Half: in one of sixteen."""
    figure, ax = canvas(3.9, -6.9, 1.7)
    numbers = [f"{i}" for i in range(8)]
    label(ax, 0.1, 1.2, "full: two registers of eight lanes", bold=True)
    lanes(ax, 0.1, -0.2, [BOXES] * 8, numbers)
    label(ax, 8.4, 0.2, "where the ray enters each box")
    lanes(ax, 0.1, -1.2, [VERTICES] * 8, numbers)
    label(ax, 8.4, -0.8, "where it leaves each box")
    label(ax, 0.1, -2.0, "Two fused multiply-adds per axis. One comparison gives the hits.")
    label(ax, 0.1, -3.7, "half: one register of sixteen lanes", bold=True)
    lanes(ax, 0.1, -5.1, [BOXES] * 8 + [VERTICES] * 8, numbers * 2)
    label(ax, 0.1, -5.7, "where the ray enters each box")
    label(ax, 8.1, -5.7, "where it leaves, negated")
    label(
        ax,
        0.1,
        -6.5,
        "One fused multiply-add per axis, and one insert to put two rows of planes side by side.",
    )
    return figure


def draw_lanes() -> Figure:
    """L = 8: one thread per ray. L = 1: eight threads per ray, one per lane of a node."""
    figure, ax = canvas(5.4, -9.9, 2.0)
    label(ax, 0.1, 1.5, "L = 8: a thread is a ray, and does all eight lanes itself", bold=True)
    threads = [f"{i}" for i in range(16)]
    lanes(ax, 0.1, 0.1, [RAYS[i % 4] for i in range(16)], threads)
    label(ax, 0.1, -0.35, "threads 0 to 15 of a warp: sixteen rays")
    for lane in range(8):
        y = -1.3 - 0.44 * lane
        ax.add_patch(Rectangle((0.1, y), 1, 0.44, facecolor=RAYS[0], edgecolor=EDGE, linewidth=0.9))
        ax.text(1.3, y + 0.2, f"lane {lane}", size=8.5, va="center", color=FAINT)
    label(ax, 3.2, -2.5, "No thread needs another one: most rays per second,")
    label(ax, 3.2, -3.2, "if there are enough rays to fill the GPU.")
    label(ax, 0.1, -6.1, "L = 1: eight threads are a ray, and each does one lane", bold=True)
    lanes(ax, 0.1, -7.5, [RAYS[i // 8] for i in range(16)], [f"{i % 8}" for i in range(16)])
    label(ax, 0.1, -7.95, "threads 0 to 7: ray 0, lanes 0 to 7")
    label(ax, 8.1, -7.95, "threads 8 to 15: ray 1")
    label(ax, 0.1, -8.9, "The eight agree on hits, order and the nearest hit by reductions within the warp:")
    label(ax, 0.1, -9.6, "half the time per ray, for launches of few rays.")
    return figure
