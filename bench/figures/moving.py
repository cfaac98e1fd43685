"""The figure of `bench moving`: milliseconds until a scene has a mesh at its new place."""

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from bench.figures import style
from bench.support.report import Row

WAYS = {
    "geom_ms": ("refit(geom=)", style.OURS),
    "refit_ms": ("refit of all", style.THEIRS),
    "build_ms": ("a new scene", style.OTHER),
}


def draw(content: Row) -> Figure:
    """A row per scene and mesh that moves, a dot per way."""
    rows = content["rows"]
    ours = [row["geom_ms"] for row in rows]
    gain = max(row["build_ms"] / row["geom_ms"] for row in rows)
    figure, (axes,) = style.page(
        1.6 + 0.36 * len(rows),
        f"One mesh moves in {min(ours):.1f} to {max(ours):.0f} ms,\n"
        f"a new scene takes up to {gain:,.0f} times as long",
        "Medians on all cores",
    )
    style.rows(
        axes, [f"{style.short(row['moving'])} of {style.short(row['triangles'])} triangles" for row in rows]
    )
    axes.set_ylim(len(rows) - 0.4, -1.1)
    for column, (_, color) in WAYS.items():
        axes.plot([row[column] for row in rows], range(len(rows)), "o", color=color, markersize=8, zorder=3)
    for y, row in enumerate(rows):
        times = [row[column] for column in WAYS]
        axes.plot([min(times), max(times)], [y, y], color=style.GRID, linewidth=3, zorder=1)
    axes.set_xscale("log")
    high = axes.get_xlim()[1]
    axes.set_xlim(right=high * 2)
    first = sorted((rows[0][column], *WAYS[column]) for column in WAYS)
    for (time, name, color), ha, shift in zip(first, ("right", "right", "left"), (26, 8, -6), strict=True):
        style.name_point(axes, time, -0.7, name, color, (shift, 0), ha)
    axes.xaxis.set_major_locator(LogLocator())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} ms"))
    return figure
