"""The figure of `bench inflight`: speed over that of one ray at a time, for three sizes of trees."""

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from bench.figures import style
from bench.support.report import Row

COLORS = ("#54aeff", style.OURS, "#0a3069")  # from small to large trees
DEFAULT = 24  # rays in flight of a batch (docs/design.md)


def draw(content: Row) -> Figure:
    """A line for the smallest, the middle and the largest tree."""
    kinds = list(dict.fromkeys(row["rays"] for row in content["rows"]))
    kind = "random" if "random" in kinds else kinds[0]
    rows = [row for row in content["rows"] if row["rays"] == kind and row["in_flight"] != "tuned"]
    sizes = sorted({row["triangles"] for row in rows})
    chosen = sorted({sizes[0], sizes[len(sizes) // 2], sizes[-1]})
    lines = [
        sorted(
            (row["in_flight"], row["speedup"], row["tree_mib"]) for row in rows if row["triangles"] == size
        )
        for size in chosen
    ]
    best = [max(speed for _, speed, _ in line) for line in lines]
    figure, (axes,) = style.page(
        4.0,
        f"Many rays in flight: {style.span(best, 1)} times the speed\nof one ray at a time",
        f"One thread, {kind} rays, accuracy {content['accuracy']}, {content['kernel'].upper()}",
    )
    ends = []
    for color, line in zip(COLORS[-len(lines) :], lines, strict=True):
        flights, speeds, trees = zip(*line, strict=True)
        axes.plot(flights, speeds, "o-", color=color, linewidth=2.2, markersize=5)
        ends.append(
            (
                speeds[-1],
                f"tree of\n{trees[0]:.1f} MiB" if trees[0] < 10 else f"tree of\n{trees[0]:.0f} MiB",
                color,
            )
        )
    axes.set_xscale("log", base=2)
    ticks = [k for k in (1, 2, 4, 8, 16, 32, 64) if k <= lines[0][-1][0]]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels(map(str, ticks))
    axes.set_ylim(0, 1.08 * max(best))
    if lines[0][-1][0] >= DEFAULT:
        axes.axvline(DEFAULT, color=style.THEIRS, linewidth=1.2, linestyle=":", zorder=1)
        style.name_point(
            axes, DEFAULT, 0.12 * max(best), f"default: {DEFAULT}", style.FAINT, (-6, 0), "right"
        )
    style.name_lines(axes, ends)
    style.scale(axes, "rays in flight", "speed, 1 = one ray")
    return figure
