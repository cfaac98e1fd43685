"""The figure of `bench embree`: ratio per scene and kind of rays, a panel per accuracy and kernel."""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.support.report import Row
from bench.support.timing import geometric_mean

STYLES = {"primary": ("o", "C0"), "diffuse": ("s", "C1"), "shadow": ("^", "C2"), "random": ("D", "C3")}


def draw(speed: Sequence[Row]) -> Figure:
    """Dots right of the line at 1: wive is faster."""
    accuracies = list(dict.fromkeys(row["accuracy"] for row in speed))
    contenders = list(dict.fromkeys(_contender(row) for row in speed))
    scenes = list(dict.fromkeys(row["scene"] for row in speed))
    figure, panels = pyplot.subplots(
        len(accuracies),
        len(contenders),
        figsize=(2.2 + 3.6 * len(contenders), 1.4 + len(accuracies) * (0.7 + 0.27 * len(scenes))),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for accuracy, line in zip(accuracies, panels, strict=True):
        for contender, panel in zip(contenders, line, strict=True):
            kernel, in_flight, nodes = contender
            chosen = [row for row in speed if (row["accuracy"], _contender(row)) == (accuracy, contender)]
            _draw_panel(panel, chosen, scenes)
            flying = {1: "", "tuned": ", in flight"}.get(in_flight, f", {in_flight} in flight")
            compressed = "" if nodes == "float32" else f" {nodes}"
            mean = geometric_mean([row["ratio"] for row in chosen])
            panel.set_title(f"{kernel}{compressed}{flying}, {accuracy}: mean {mean:.2f}", fontsize=9)
    for panel in panels[-1]:
        panel.set_xlabel("speed relative to Embree", fontsize=9)
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=9)
    return figure


def _contender(row: Row) -> tuple[str, int | str, str]:
    return row["kernel"], row["in_flight"], row["nodes"]


def _draw_panel(panel: Axes, rows: Sequence[Row], scenes: Sequence[str]) -> None:
    panel.axvline(1.0, color="0.4", linewidth=1, zorder=0)
    for kind, (marker, color) in STYLES.items():
        points = [(row["ratio"], scenes.index(row["scene"])) for row in rows if row["rays"] == kind]
        if points:
            x, y = zip(*points, strict=True)
            panel.scatter(x, y, s=26, marker=marker, color=color, label=kind, alpha=0.9)
    panel.set_yticks(range(len(scenes)), scenes, fontsize=8)
    panel.set_ylim(len(scenes) - 0.5, -0.5)
    panel.grid(axis="both", color="0.92", linewidth=0.8)
    panel.set_axisbelow(True)
    panel.tick_params(length=0, labelsize=8)
    panel.spines[["top", "right", "left"]].set_visible(False)
