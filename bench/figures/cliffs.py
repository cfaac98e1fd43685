"""The figure of `bench cliffs`: how much more a ray costs on inputs that could be hard."""

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from bench.figures import style
from bench.support.report import Row

PARTS = {
    "scale": "a tiny part on a wide ground",
    "distance": "origins far away",
    "plane": "rays within a floor",
    "doubt": "rays at vertices and edges",
    "leaving": "rays that leave at once, compressed",
    "misses": "misses, over Embree's",
}


def draw(content: Row) -> Figure:
    """A row per kind of input: a dot per case, orange above the bar that it was given."""
    rows, parts = content["rows"], [part for part in PARTS if any(r["part"] == part for r in content["rows"])]
    above = [row for row in rows if row["ratio"] > row["bar"]]
    figure, (axes,) = style.page(
        1.6 + 0.5 * len(parts),
        f"{len(rows) - len(above)} of {len(rows)} hard inputs stay within their goals",
        "One core. Black marks: the most that was set as a goal; orange: above it",
    )
    style.rows(axes, [PARTS[part] for part in parts])
    for y, part in enumerate(parts):
        for row in (row for row in rows if row["part"] == part):
            high = row["ratio"] > row["bar"]
            axes.plot(row["bar"], y, "|", color=style.TEXT, markersize=17, markeredgewidth=1.8, zorder=2)
            axes.plot(
                row["ratio"],
                y,
                "o",
                color=style.OTHER if high else style.OURS,
                markersize=7,
                alpha=0.7,
                zorder=3,
            )
    axes.axvline(1, color=style.THEIRS, linewidth=1.2, zorder=1)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator([0.1, 0.3, 1, 3, 10, 30, 100]))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    style.scale(axes, "seconds per ray, 1 = an ordinary input")
    return figure
