"""The figure of `bench packets`: time of pictures with packets over that without, by distance."""

import numpy as np
from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row


def draw(content: Row) -> Figure:
    """A row per distance: a dot per scene, width and query, and the geometric mean."""
    rows, summary = content["rows"], content["summary"]
    distances = list(dict.fromkeys(row["distance"] for row in rows))
    figure, (axes,) = style.page(
        1.7 + 0.5 * len(distances),
        f"With packets, pictures take {summary['mean']:.2f} of the time,\nat worst {summary['worst']:.2f}",
        f"One core, {content['kernel'].upper()}; light: each picture, dark: geometric mean",
    )
    ratios = {
        f"from {distance:g} diagonals": [row["ratio"] for row in rows if row["distance"] == distance]
        for distance in distances
    }
    style.spreads(axes, ratios)
    axes.set_xticks(np.arange(0.5, 1.3, 0.1))
    style.scale(axes, "time, 1 = without packets")
    return figure
