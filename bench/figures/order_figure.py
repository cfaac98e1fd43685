"""The figure of `bench order`: steps relative to distance order, speed relative to treelet order."""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from bench.support.report import Row

COLORS = {"treelet": "C0", "diagonal": "C1", "slots": "C4", "none": "C2", "distance": "C3"}


def draw(steps: Sequence[Row], speed: Sequence[Row]) -> Figure:
    """Bars per scene: a row of panels for inner nodes, one for the speed at each number in flight."""
    kinds = list(dict.fromkeys(row["rays"] for row in steps))
    flights = list(dict.fromkeys(row["in_flight"] for row in speed))
    scenes = list(dict.fromkeys(row["scene"] for row in steps))
    figure, panels = pyplot.subplots(
        1 + len(flights), len(kinds), sharey=True, squeeze=False, layout="constrained",
        figsize=(2.4 + 3.8 * len(kinds), (1 + len(flights)) * (0.8 + 0.55 * len(scenes))),
    )  # fmt: skip
    for column, kind in enumerate(kinds):
        chosen = [row for row in steps if row["rays"] == kind and row["order"] != "distance"]
        _bars(panels[0][column], chosen, "nodes_vs_distance", scenes)
        panels[0][column].set_xlabel("inner nodes per ray, relative to distance order", fontsize=9)
        panels[0][column].set_title(f"{kind} rays", fontsize=10)
        for i, flight in enumerate(flights):
            chosen = [row for row in speed if (row["rays"], row["in_flight"]) == (kind, flight)]
            _bars(panels[1 + i][column], chosen, "speed", scenes)
            flying = "one ray at a time" if flight == 1 else f"in flight: {flight}"
            panels[1 + i][column].set_xlabel(f"speed relative to treelet order, {flying}", fontsize=9)
    handles = [Rectangle((0, 0), 1, 1, color=color) for color in COLORS.values()]
    figure.legend(
        handles, list(COLORS), loc="outside lower center", ncols=len(COLORS), frameon=False, fontsize=9
    )
    return figure


def _bars(panel: Axes, rows: Sequence[Row], column: str, scenes: Sequence[str]) -> None:
    orders = list(dict.fromkeys(row["order"] for row in rows))
    height = 0.84 / len(orders)
    for i, order in enumerate(orders):
        values = {row["scene"]: row[column] for row in rows if row["order"] == order}
        places = [scenes.index(scene) + (i - (len(orders) - 1) / 2) * height for scene in values]
        bars = panel.barh(places, list(values.values()), height * 0.9, color=COLORS[order])
        panel.bar_label(bars, fmt="%.2f", fontsize=6, padding=2)
    panel.axvline(1.0, color="0.4", linewidth=1)
    panel.set_yticks(range(len(scenes)), scenes, fontsize=8)
    panel.set_ylim(len(scenes) - 0.5, -0.5)
    panel.margins(x=0.12)
    panel.tick_params(length=0, labelsize=8)
    panel.spines[["top", "right", "left"]].set_visible(False)
