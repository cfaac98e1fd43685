"""The figure of `bench peers`: speed of wive's batches over other libraries' rays."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.figures.embree import KINDS
from bench.support.report import Row
from bench.support.timing import geometric_mean

NAMES = {"tinybvh": "tinybvh", "bvh": "madmann91/bvh"}


def draw(content: Row) -> Figure:
    """A panel per library, a row per kind of rays: a dot per scene, and the geometric mean."""
    rows = [row for row in content["rows"] if row["builder"] == "usual"]
    peers = [peer for peer in NAMES if any(row["peer"] == peer for row in rows)]
    kinds = [kind for kind in KINDS if any(row["rays"] == kind for row in rows)]
    means = [geometric_mean([row["watertight"] for row in rows if row["peer"] == peer]) for peer in peers]
    parts = [f"{mean:.1f} times {NAMES[peer]}" for peer, mean in zip(peers, means, strict=True)]
    scenes = len({row["scene"] for row in rows})
    figure, panels = style.page(
        1.2 + 0.55 * len(kinds) * len(peers), "Speed: " + ", ".join(parts),
        f"One core, AVX2, watertight batches; light: each of {scenes} scenes, dark: geometric mean",
        rows=len(peers), sharex=True,
    )  # fmt: skip
    for peer, axes in zip(peers, panels, strict=True):
        ratios = {
            KINDS[kind]: [row["watertight"] for row in rows if (row["peer"], row["rays"]) == (peer, kind)]
            for kind in kinds
        }
        style.spreads(axes, ratios)
        style.subject(axes, f"over {NAMES[peer]}")
    panels[-1].set_xlim(left=0)  # of all panels, when each has its dots
    style.scale(panels[-1], "speed, 1 = the other library")
    return figure
