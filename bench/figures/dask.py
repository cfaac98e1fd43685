"""The figure of `bench dask`: speed of wive.dask beside one call of the scene."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row


def draw(content: Row) -> Figure:
    """A bar per way to trace, of the first scene."""
    rows = [row for row in content["rows"] if row["scene"] == content["rows"][0]["scene"]]
    shares = [100 * row["speed"] for row in rows[1:]]
    figure, (axes,) = style.page(
        1.25 + 0.4 * len(rows),
        f"wive.dask keeps {min(shares):.0f} to {max(shares):.0f} % of the speed of one call",
        f"Two cores, {rows[0]['scene']}, {rows[0]['count']:,} rays",
    )
    style.bars(
        axes, [row["contender"] for row in rows], [row["mrays"] for row in rows],
        [f"{row['mrays']:.1f}" for row in rows], [style.THEIRS, *[style.OURS] * (len(rows) - 1)],
    )  # fmt: skip
    style.subject(axes, "million rays per second")
    return figure
