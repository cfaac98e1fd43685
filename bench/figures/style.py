"""The look of every figure: a message as its title, names beside what they name, no legend.

Sizes are chosen so that a figure can be read when it is 300 pixels wide.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter

from bench.support.timing import geometric_mean

WIDTH = 6.4  # inches
OURS, THEIRS, OTHER = "#0969da", "#8c959f", "#bc4c00"
LIGHT = "#b6d4fe"  # single values behind a mean of ours
TEXT, FAINT, GRID = "#24292f", "#57606a", "#e4e8ec"
NAME_SIZE, NOTE_SIZE, MESSAGE_SIZE = 11, 9.5, 13.5  # points
LINE_HEIGHT = 1.35  # of names, in their size


def page(
    height: float,
    message: str,
    note: str,
    columns: int = 1,
    rows: int = 1,
    sharex: bool = False,
    heights: Sequence[float] | None = None,
) -> tuple[Figure, list[Axes]]:
    """A figure of so many inches with its message above and a note on the conditions below; its panels."""
    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.07))
    figure.suptitle(message, x=0.015, ha="left", size=MESSAGE_SIZE, weight="bold", color=TEXT)
    figure.supxlabel(note, x=0.015, ha="left", size=NOTE_SIZE, color=FAINT)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=sharex, height_ratios=heights)
    for axes in panels.flat:
        plain(axes)
    return figure, list(panels.flat)


def plain(axes: Axes) -> None:
    """Removes frames and marks, which carry no numbers."""
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0, labelsize=NAME_SIZE - 1, labelcolor=TEXT, which="both")
    axes.grid(color=GRID, linewidth=0.9)
    axes.set_axisbelow(True)


def subject(axes: Axes, text: str) -> None:
    """What a panel shows, above it."""
    axes.set_title(text, loc="left", size=NAME_SIZE, color=FAINT)


def scale(axes: Axes, x: str = "", y: str = "") -> None:
    """Names of the axes."""
    axes.set_xlabel(x, size=NAME_SIZE, color=FAINT)
    axes.set_ylabel(y, size=NAME_SIZE, color=FAINT)


def name_point(
    axes: Axes,
    x: float,
    y: float,
    name: str,
    color: str,
    offset: tuple[float, float] = (9, 0),
    ha: str = "left",
) -> None:
    """A name beside a point, moved by so many points."""
    axes.annotate(
        name, (x, y), offset, textcoords="offset points", ha=ha, va="center", size=NAME_SIZE, color=color,
        zorder=5,
    )  # fmt: skip


def name_lines(axes: Axes, ends: Sequence[tuple[float, str, str]]) -> None:
    """Names at the right of the axes, of lines that end at these heights: (y, name, colour).

    Names that would touch are moved apart. Limits and scales must have been set before.
    """
    low, high = axes.get_ylim()
    figure = axes.get_figure(root=True)
    assert figure is not None
    step = LINE_HEIGHT * NAME_SIZE / 72 / (0.66 * figure.get_size_inches()[1])  # of the axes' height
    log = axes.get_yscale() == "log"

    def share(y: float) -> float:
        return float(np.log(y / low) / np.log(high / low) if log else (y - low) / (high - low))

    ordered = sorted(ends, key=lambda end: end[0])
    places = [share(y) for y, _, _ in ordered]
    tops = [step * (1 + name.count("\n")) for _, name, _ in ordered]
    for _ in range(100):
        for i in range(1, len(places)):
            close = (tops[i - 1] + tops[i]) / 2 - (places[i] - places[i - 1])
            if close > 1e-6:
                places[i - 1] -= close / 2
                places[i] += close / 2
    for place, (_, name, color) in zip(places, ordered, strict=True):
        axes.text(
            1.015, place, name, transform=axes.transAxes, va="center", size=NAME_SIZE, color=color,
            linespacing=1.1,
        )  # fmt: skip


def bars(
    axes: Axes, names: Sequence[str], values: Sequence[float], texts: Sequence[str], colors: Sequence[str]
) -> None:
    """Horizontal bars from top to bottom with their names at the left and their values as text at the end."""
    drawn = axes.barh(range(len(names)), values, color=colors, height=0.68)
    axes.bar_label(drawn, labels=texts, padding=4, size=NAME_SIZE, color=TEXT)
    rows(axes, names)
    axes.set_xticks([])
    axes.grid(visible=False)
    low, high = min(0.0, *values), max(0.0, *values)
    room = 0.2 * (high - low)
    axes.set_xlim(low - (room if low < 0 else 0), high + room)


def rows(axes: Axes, names: Sequence[str]) -> None:
    """A row per name, from top to bottom."""
    axes.set_yticks(range(len(names)), names, size=NAME_SIZE)
    axes.set_ylim(len(names) - 0.4, -0.6)


def spreads(axes: Axes, values: Mapping[str, Sequence[float]], beside: float | None = 1) -> None:
    """A row per name with its single values and their geometric mean; a line at the value to compare with."""
    rows(axes, list(values))
    axes.set_ylim(len(values) - 0.5, -0.75)
    for y, found in enumerate(values.values()):
        spread(axes, y, found, geometric_mean(list(found)))
    if beside is not None:
        axes.axvline(beside, color=THEIRS, linewidth=2, zorder=1)


def spread(
    axes: Axes, y: float, values: Sequence[float], mean: float, color: str = OURS, form: str = "{:.2f}"
) -> None:
    """Single values as light dots on a line, and their mean as a dot with its number above."""
    axes.plot([min(values), max(values)], [y, y], color=LIGHT, linewidth=2, zorder=2)
    axes.plot(values, [y] * len(values), "o", color=LIGHT, markersize=6, zorder=3)
    axes.plot(mean, y, "o", color=color, markersize=9, zorder=4)
    name_point(axes, mean, y, form.format(mean), color, (0, 11), "center")


def logarithmic(axes: Axes) -> None:
    """Logarithmic scales, of counts along x and of plain numbers along y; limits stay as they are then."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: short(value)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylim(*axes.get_ylim())


def span(values: Sequence[float], digits: int) -> str:
    """From the lowest to the highest, or the one value that there is."""
    ends = (min(values), max(values)) if len(values) > 1 else values
    return " to ".join(f"{value:.{digits}f}" for value in ends)


def short(count: float) -> str:
    """A count in thousands or millions."""
    if count >= 999_500:
        return f"{count / 1e6:.0f} M" if count >= 9.95e6 else f"{count / 1e6:.1f} M"
    return f"{count / 1e3:.0f} k" if count >= 1000 else f"{count:.0f}"
