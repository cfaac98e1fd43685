"""The figure of `bench build`: seconds over triangles, beside Embree's."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row


def draw(content: Row) -> Figure:
    """A line of wive and one of Embree, of most threads and the first quality."""
    build = content["build"]
    threads, quality = max(row["threads"] for row in build), build[0]["quality"]
    rows = sorted(
        (row for row in build if (row["threads"], row["quality"]) == (threads, quality)),
        key=lambda row: int(row["triangles"]),
    )
    parts = [1 / row["ratio"] for row in rows]
    figure, (axes,) = style.page(
        4.0,
        f"Building takes {style.span(parts, 2)} of Embree's time,\n"
        f"up to {style.short(rows[-1]['triangles'])} triangles",
        f"{threads} thread{'s' * (threads > 1)}, quality {quality}; terrain and cars",
    )
    ends = []
    for side, name, color in (("embree", "Embree", style.FAINT), ("wive", "wive", style.OURS)):
        seconds = [row[f"{side}_seconds"] for row in rows]
        axes.plot(
            [row["triangles"] for row in rows], seconds, "o-" if side == "wive" else "s--", color=color,
            linewidth=2.2, markersize=6, markerfacecolor=color if side == "wive" else "white",
        )  # fmt: skip
        ends.append((seconds[-1], name, color))
    style.logarithmic(axes)
    style.name_lines(axes, ends)
    style.scale(axes, "triangles", "seconds")
    return figure
