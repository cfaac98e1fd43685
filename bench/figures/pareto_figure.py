"""The figure of `bench pareto`: speed against leaks and wrong triangles, leaks by scale and place."""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.support.report import Row

FLOOR = 1e-7  # the height at which a rate of zero is drawn


def draw(means: Sequence[Row], rows: Sequence[Row]) -> Figure:
    """Above: each contender at its speed and rate of errors. Below: its leaks over the sweeps."""
    figure, panels = pyplot.subplots(2, 2, figsize=(11, 8), layout="constrained")
    names = [row["contender"] for row in means]
    for panel, column, label in zip(
        panels[0],
        ("leaks", "wrong"),
        ("rays at vertices and edges that leak", "rays that hit the wrong triangle"),
        strict=True,
    ):
        for i, row in enumerate(means):
            rate = max(row[column], FLOOR)
            panel.scatter(row["mrays"], rate, color=f"C{i}", zorder=3)
            if row["single"] is not None:
                panel.scatter(row["single"], rate, facecolors="none", edgecolors=f"C{i}", zorder=3)
            panel.annotate(
                row["contender"],
                (row["mrays"], rate),
                (5, 5 + 9 * (i % 4)),
                textcoords="offset points",
                fontsize=8,
            )
        _rate_axis(panel, label)
        panel.set_xlabel("Mray/s on one core; hollow: one ray at a time")
        panel.set_xlim(left=0)
    for panel, column, label, fixed in zip(
        panels[1],
        ("scale", "place"),
        ("radius", "distance of the centre in radii"),
        ("place", "scale"),
        strict=True,
    ):
        home = 0.0 if fixed == "place" else 1.0
        for i, name in enumerate(names):
            line = [
                row for row in rows if row["contender"] == name and row[fixed] == home and row[column] > 0
            ]
            panel.plot(
                [row[column] for row in line], [max(row["leaks"], FLOOR) for row in line],
                marker="o", markersize=4, color=f"C{i}", label=name,
            )  # fmt: skip
        _rate_axis(panel, "rays at vertices and edges that leak")
        panel.set_xscale("log")
        panel.set_xlabel(label)
    panels[1][0].legend(frameon=False, fontsize=8)
    return figure


def _rate_axis(panel: Axes, label: str) -> None:
    panel.set_yscale("log")
    panel.set_ylim(FLOOR / 2, 1)
    panel.set_yticks(
        [FLOOR, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1], ["0", *(f"1e-{n}" for n in range(6, 0, -1)), "1"]
    )
    panel.set_ylabel(label)
    panel.grid(which="major", color="0.92", linewidth=0.8)
    panel.spines[["top", "right"]].set_visible(False)
