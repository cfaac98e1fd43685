"""Figures of the results: one module per bench, which draws the content of its JSON file."""

import importlib
from typing import TYPE_CHECKING

from bench.support.report import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWN = (
    "build", "cliffs", "closest", "dask", "embree", "inflight", "interrupts", "latency", "moving", "order",
    "packets", "paper", "pareto", "peers", "python", "spawn", "stream",
)  # fmt: skip


def draw(name: str, content: Row) -> "Figure | None":
    """The figure of a bench's content; None if the bench has no figure or measured nothing that is drawn.

    NAME-DEVICE is drawn as NAME.
    """
    bench = name.split("-")[0]
    if bench not in DRAWN:
        return None
    figure: Figure | None = importlib.import_module(f"bench.figures.{bench}").draw(content)
    return figure
