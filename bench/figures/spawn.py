"""The figure of `bench spawn`: what follows a trace, beside the trace."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row
from bench.support.timing import geometric_mean

PARTS = {
    "spawn": "spawn rays",
    "normals": "normals",
    "points": "points",
    "error_bound": "error bounds",
}


def draw(content: Row) -> Figure:
    """A row per output: a dot per scene and precision, and the geometric mean."""
    rows = content["rows"]
    mean = geometric_mean([row["spawn"] for row in rows])
    scenes = len({row["scene"] for row in rows})
    figure, (axes,) = style.page(
        1.6 + 0.5 * len(PARTS),
        f"Spawning rays from hits takes {mean:.2f} of tracing them",
        f"One core; light: each of {scenes} scenes in float32 and float64, dark: geometric mean",
    )
    style.spreads(axes, {name: [row[part] for row in rows] for part, name in PARTS.items()}, beside=None)
    axes.set_xlim(left=0)
    style.scale(axes, "seconds, 1 = the trace of the hits")
    return figure
