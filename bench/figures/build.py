"""The figure of `bench build`: seconds over triangles, beside Embree's."""

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

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
    count = f"{min(parts):.2f} to {max(parts):.2f}" if len(parts) > 1 else f"{parts[0]:.2f}"
    figure, (axes,) = style.page(
        4.0,
        f"Building takes {count} of Embree's time,\nup to {style.short(rows[-1]['triangles'])} triangles",
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
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: style.short(value)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylim(*axes.get_ylim())
    style.name_lines(axes, ends)
    style.scale(axes, "triangles", "seconds")
    return figure
