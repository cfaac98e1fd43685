"""Draws the pictures of docs/how_it_works.md: the small tree's root, a visit, a walk, registers, GPU lanes.

python docs/figures/how_it_works.py

Writes how_node.svg, how_visit.svg, how_walk.svg, how_walk.gif, how_forms.svg, how_lanes.svg in docs/images.
"""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib as mpl

mpl.use("agg")
import matplotlib.pyplot as plt
import numpy as np
from drawing import ARROW, HIGH, HIT, LIGHT, LOW, MISS, RAY, box, cell, draw_ray, draw_stack, world
from layout import BOXES, CHILDREN, EDGE, FAINT, ORDERS
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from PIL import Image
from registers import draw_forms, draw_lanes
from small_tree import LEAF, Step, Tree, ray, scene_over, segments, treelet, walk

IMAGES = Path(__file__).resolve().parents[1] / "images"


def draw_treelet(ax: Axes, tree: tuple | int, left: float, y: float) -> tuple[float, float]:
    """The binary treelet below y, leaves from `left` on; its middle and the x after it."""
    if isinstance(tree, int):
        cell(ax, left, y, f"{tree}", BOXES)
        return left, left + 1.15
    axis, low, high = tree
    a, middle = draw_treelet(ax, low, left, y - 1.25)
    b, end = draw_treelet(ax, high, middle, y - 1.25)
    x = (a + b) / 2
    for child, side in ((a, low), (b, high)):
        top = y - 0.89 if isinstance(side, int) else y - 0.93
        ax.plot([x, child], [y - 0.3, top], color=FAINT, linewidth=1.2, zorder=1)
    ax.text(x, y, "xyz"[axis], ha="center", va="center", size=12, weight="bold", color=EDGE,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": ORDERS, "edgecolor": EDGE})  # fmt: skip
    return x, end


def draw_node(tree: Tree) -> Figure:
    """The root: its eight boxes, the treelet of its splits, and the order of each octant."""
    root = tree.nodes[0]
    figure = plt.figure(figsize=(7.6, 7.9))
    above = figure.add_axes((0.02, 0.55, 0.96, 0.44))
    world(above)
    for slot in root.used:
        box(above, root, slot, "#1d5c99", f"{slot}")
    ax = figure.add_axes((0.02, 0.01, 0.96, 0.53))
    draw_treelet(ax, treelet(root), 0.6, -0.4)
    ax.text(0.1, 0.75, "The treelet: which axis parts them", size=12, weight="bold", color=EDGE, va="center")
    ax.text(10.2, 0.75, "Front to back, by the ray's signs", size=12, weight="bold", color=EDGE, va="center")
    for row, (octant, signs) in enumerate(((0, "→ ↑"), (1, "← ↑"), (2, "→ ↓"), (3, "← ↓"))):
        y = -0.55 - row * 0.95
        ax.text(9.7, y, signs, size=13, va="center", color=EDGE)
        for i, slot in enumerate(root.order[octant]):
            cell(ax, 11.7 + i, y, f"{slot}", ORDERS)
    note = "The last row is the first one backwards,\nand the two between are each other backwards."
    ax.text(9.7, -4.7, note, size=10.5, color=FAINT, va="center")
    ax.set_xlim(0, 19.3)
    ax.set_ylim(-7.1, 1.2)
    ax.axis("off")
    return figure


def draw_visit(tree: Tree, step: Step) -> Figure:
    """One visit: order, slabs, compress, store."""
    node = tree.nodes[0]
    figure = plt.figure(figsize=(7.6, 8.6))
    above = figure.add_axes((0.02, 0.57, 0.96, 0.42))
    world(above)
    for slot in node.used:
        is_hit = slot in step.hit
        box(above, node, slot, HIT if is_hit else MISS, f"{slot}", width=1.8 if is_hit else 1)
    draw_ray(above, 11)
    ax = figure.add_axes((0.02, 0.01, 0.96, 0.55))
    order_row, enter_row, leave_row, permuted_row, stack_row = 0.0, -2.2, -3.0, -5.2, -7.4
    for y, text in (
        (order_row, "(A) order: the slots as rays to the right and up meet them"),
        (enter_row, "(B) slabs: eight boxes at once; a box is hit if the ray enters before it leaves"),
        (permuted_row, "(C) permute the hits into that order, and compress"),
    ):
        ax.text(0.02, y + 0.85, text, size=11.5, weight="bold", color=EDGE, va="center")
    for y, text in (
        (order_row, "slot, in order"),
        (enter_row, "enters at"),
        (leave_row, "leaves at"),
        (permuted_row, "slot, in order"),
        (stack_row, "child"),
    ):
        ax.text(2.35, y, text, ha="right", va="center", size=10.5, color=EDGE)
    for i, slot in enumerate(int(s) for s in node.order[0]):
        cell(ax, 3 + i, order_row, f"{slot}", ORDERS)
        color = CHILDREN if i in step.hit else "white"
        cell(ax, 3 + i, enter_row, f"{step.near[i]:.1f}", color)
        cell(ax, 3 + i, leave_row, f"{round(step.far[i], 1) + 0.0:.1f}", color)
        ax.text(3 + i, leave_row - 0.44, f"slot {i}", ha="center", va="top", size=8.5, color=FAINT)
        if slot not in step.hit:
            cell(ax, 3 + i, permuted_row, f"{slot}", "white", LIGHT, MISS)
            continue
        cell(ax, 3 + i, permuted_row, f"{slot}", CHILDREN)
        target = 3 + 1.08 * step.hit.index(slot)
        style = ARROW | {"linewidth": 1.1, "mutation_scale": 10}
        ends = (3 + i, permuted_row - 0.42), (target, stack_row + 0.4)
        ax.add_patch(FancyArrowPatch(*ends, color=HIT, zorder=0, **style))
    draw_stack(ax, tree, step.stack, 3, stack_row, np.inf)
    told = "(D) store on the stack,\nthe nearest as the next"
    ax.text(6.6, stack_row, told, size=11.5, weight="bold", color=EDGE, va="center")
    ax.set_xlim(0, 11.2)
    ax.set_ylim(-8.4, 1.2)
    ax.axis("off")
    return figure


def draw_step(ax: Axes, tree: Tree, steps: list[Step], number: int, end: float) -> None:
    """What the step of this number saw, and the stack behind it; end: t of the hit."""
    step = steps[number]
    world(ax)
    ax.set_ylim(LOW[1] - 1.9, HIGH[1] + 0.7)
    for parent in tree.nodes:  # the box that is visited
        for slot in parent.used:
            if int(parent.child[slot]) == step.reference:
                box(ax, parent, slot, EDGE, "", fill="#f4f6f8", width=1.2)
    if step.reference & LEAF:
        for prim in step.tested:
            ax.plot(*segments()[prim].T, color=HIT, linewidth=3.2, solid_capstyle="round", zorder=4)
        outcome = "hit" if step.found >= 0 else "missed"
        told = f"Leaf {tree.name(step.reference)}: {len(step.tested)} triangles, {outcome}"
    else:
        node = tree.node(step.reference)
        for slot in node.used:
            is_hit = slot in step.hit
            name = tree.name(int(node.child[slot])) if is_hit else ""
            box(ax, node, slot, HIT if is_hit else MISS, name, width=1.8 if is_hit else 0.8)
        told = f"Node {tree.name(step.reference)}: {len(step.hit)} of {len(node.used)} boxes hit"
    is_found = any(s.found >= 0 for s in steps[: number + 1])
    draw_ray(ax, end if is_found else 11)
    ax.text(
        LOW[0], HIGH[1] + 0.45, f"{number + 1}. {told}", size=11.5, weight="bold", color=EDGE, va="center"
    )
    ax.text(LOW[0], LOW[1] - 0.55, "stack", size=10.5, color=EDGE, va="center")
    draw_stack(ax, tree, step.stack, LOW[0] + 2.0, LOW[1] - 0.55, end if is_found else np.inf, 1.2)
    if is_found:
        ax.text(
            LOW[0] + 1.5,
            LOW[1] - 1.7,
            f"all behind the hit at {end:.2f}: dropped",
            size=9.5,
            color=FAINT,
            va="center",
        )


def draw_walk(tree: Tree, steps: list[Step], end: float) -> Figure:
    """All steps, two to a row."""
    rows = (len(steps) + 1) // 2
    figure, axes = plt.subplots(rows, 2, figsize=(7.6, 2.95 * rows))
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.005, top=0.995, wspace=0.04, hspace=0.04)
    for number, ax in enumerate(axes.ravel()):
        ax.axis("off")
        if number < len(steps):
            draw_step(ax, tree, steps, number, end)
    return figure


def animation(tree: Tree, steps: list[Step], end: float) -> list[Image.Image]:
    """A frame per step."""
    frames = []
    for number in range(len(steps)):
        figure = plt.figure(figsize=(6.4, 5.2), dpi=100)
        draw_step(figure.add_axes((0.01, 0.0, 0.98, 1.0)), tree, steps, number, end)
        data = io.BytesIO()
        figure.savefig(data, format="png")
        plt.close(figure)
        frames.append(Image.open(data).convert("RGB").quantize(32, dither=Image.Dither.NONE))
    return frames


def save(figure: Figure, name: str) -> None:
    """Write a drawing as SVG with text as text."""
    figure.savefig(IMAGES / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)


def main() -> None:
    """Write the drawings."""
    mpl.rcParams.update(
        {"svg.fonttype": "none", "svg.hashsalt": "how it works", "font.family": "DejaVu Sans"}
    )
    scene = scene_over(segments())
    tree = Tree(scene)
    origin, direction = ray(*RAY)
    steps = walk(tree, scene, origin, direction)
    end = float(scene.intersect(origin, direction).t[0])
    save(draw_node(tree), "how_node")
    save(draw_visit(tree, steps[0]), "how_visit")
    save(draw_walk(tree, steps, end), "how_walk")
    save(draw_forms(), "how_forms")
    save(draw_lanes(), "how_lanes")
    first, *others = animation(tree, steps, end)
    times = [1800] * len(others) + [4000]
    first.save(
        IMAGES / "how_walk.gif", save_all=True, append_images=others, duration=times, loop=0, optimize=True
    )


if __name__ == "__main__":
    main()
