"""Draws docs/images/layout.svg: a node, a triangle block and a child reference, as in cpu/core/layout.h.

python docs/figures/layout.py
"""

from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

TARGET = Path(__file__).resolve().parents[1] / "images" / "layout.svg"

NODE_ROWS = ("lo.x", "hi.x", "lo.y", "hi.y", "lo.z", "hi.z", "child", "order")
BLOCK_ROWS = (*(f"v{k}.{axis}" for k in range(3) for axis in "xyz"), "prim")
BOXES, CHILDREN, ORDERS, VERTICES = "#d7e6f5", "#f7dcc1", "#dcefd5", "#ece3f5"
EDGE, FAINT = "#30363d", "#57606a"
ROW_HEIGHT = 0.62


def cell(ax: Axes, x: float, y: float, width: float, color: str, text: str = "", size: float = 8.5) -> None:
    """One box of the drawing, its lower left corner at x, y."""
    ax.add_patch(Rectangle((x, y), width, ROW_HEIGHT, facecolor=color, edgecolor=EDGE, linewidth=0.8))
    ax.text(x + width / 2, y + ROW_HEIGHT / 2, text, ha="center", va="center", size=size, color=EDGE)


def note(ax: Axes, x: float, y: float, text: str, align: str = "left", size: float = 9, **style: str) -> None:
    """Text beside the boxes."""
    ax.text(x, y, text, ha=align, va="center", size=size, color=style.pop("color", FAINT), **style)


def draw_rows(ax: Axes, x: float, top: float, names: tuple[str, ...], lanes: int, colors: list[str]) -> None:
    """A table of rows and lanes, with the lanes' numbers above and the rows' byte offsets at the left."""
    for lane in range(lanes):
        note(ax, x + lane + 0.5, top + 0.25, f"{lane}", "center", 8)
    for row, (name, color) in enumerate(zip(names, colors, strict=True)):
        y = top - (row + 1) * ROW_HEIGHT
        note(ax, x - 0.2, y + ROW_HEIGHT / 2, f"{row * lanes * 4}", "right", 8)
        for lane in range(lanes):
            cell(ax, x + lane, y, 1, color, name)


def draw_node(ax: Axes, x: float, top: float) -> None:
    """Eight rows of eight lanes."""
    note(ax, x, top + 0.85, "Node: 256 bytes, eight rows of eight 32-bit lanes", color=EDGE, weight="bold")
    draw_rows(ax, x, top, NODE_ROWS, 8, [BOXES] * 6 + [CHILDREN, ORDERS])
    right = x + 8.25
    planes = "planes of eight boxes;\na ray reads the near and\nthe far row of each axis\nby its sign there"
    order = "lane i: the slot that comes\ni-th, 4 bits per octant"
    for row, text in ((2.5, planes), (6, "child references"), (7, order)):
        note(ax, right, top - (row + 0.5) * ROW_HEIGHT, text)


def draw_block(ax: Axes, x: float, top: float) -> None:
    """Ten rows of four lanes."""
    note(ax, x, top + 0.85, "Triangle block: 160 bytes", color=EDGE, weight="bold")
    draw_rows(ax, x, top, BLOCK_ROWS, 4, [VERTICES] * 9 + [CHILDREN])
    note(ax, x + 4.2, top - 4.5 * ROW_HEIGHT, "four\ntriangles\nside by\nside")
    note(ax, x + 4.2, top - 9.5 * ROW_HEIGHT, "prim -1:\nno triangle")


def draw_reference(ax: Axes, x: float, y: float) -> None:
    """The bits of a child reference."""
    note(ax, x, y + 1.55, "Child reference: 32 bits", color=EDGE, weight="bold")
    for left, width, bits, text, color in (
        (0, 1.3, "31", "leaf", CHILDREN),
        (1.3, 7.2, "30 ... 3", "where the child begins, in units of 32 bytes", BOXES),
        (8.5, 3.0, "2 ... 0", "leaf: blocks - 1", VERTICES),
    ):
        cell(ax, x + left, y, width, color, text)
        note(ax, x + left + width / 2, y + ROW_HEIGHT + 0.25, bits, "center", 8)
    address = "address = units + 4 * (reference & 0x7ffffff8), for nodes and leaves alike"
    note(ax, x + 11.8, y + ROW_HEIGHT / 2, address)


def draw_memory(ax: Axes, x: float, y: float) -> None:
    """The one array of nodes and blocks."""
    note(ax, x, y + 1.05, "Memory: one array, all nodes and then all blocks", color=EDGE, weight="bold")
    left = x
    for text, width, color in (
        ("root", 2.2, BOXES),
        ("node", 2.2, BOXES),
        ("node", 2.2, BOXES),
        ("...", 1.0, "white"),
        ("block", 1.6, VERTICES),
        ("block", 1.6, VERTICES),
        ("...", 1.0, "white"),
    ):
        cell(ax, left, y, width, color, text)
        left += width
    note(ax, left + 0.3, y + ROW_HEIGHT / 2, "a node takes 8 units, a block 5")


def main() -> None:
    """Write the figure."""
    mpl.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "layout"})
    mpl.rcParams["font.family"] = ["DejaVu Sans", "sans-serif"]
    figure, ax = plt.subplots(figsize=(11.5, 6.1))
    ax.set_xlim(-0.9, 21.3)
    ax.set_ylim(-4.9, 7.0)
    ax.axis("off")
    draw_node(ax, 0.4, 5.6)
    draw_block(ax, 14.6, 5.6)
    draw_reference(ax, 0, -2.4)
    draw_memory(ax, 0, -4.5)
    figure.savefig(TARGET, bbox_inches="tight", facecolor="white", metadata={"Date": None})


if __name__ == "__main__":
    main()
