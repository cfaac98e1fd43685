"""The figure of `bench latency`: million rays per second over the rays of a call."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row

BACKENDS = ("avx512", "avx2", "neon", "scalar")  # one of them is drawn, the first that there is
NAMES = {
    "embreex": ("embreex", style.OTHER),
    "mesh_query_ray sah": ("Warp", "#8250df"),
}
NOT_DRAWN = "mesh_query_ray cubql"  # lies near the other of Warp's trees
NEARLY = 0.9  # of the highest speed


def draw(content: Row) -> Figure | None:
    """A line per contender."""
    curve = content["curve"]
    if not curve:
        return None
    found = dict.fromkeys(row["contender"] for row in curve)
    backend = next((name for name in BACKENDS if name in found), next(iter(found)))
    drawn = [name for name in found if name == backend or name not in (*BACKENDS, NOT_DRAWN)]
    ours = [row for row in curve if row["contender"] == backend]
    full = next(row["batch"] for row in ours if row["mrays"] >= NEARLY * max(r["mrays"] for r in ours))
    threads = content["threads"]
    figure, (axes,) = style.page(
        4.2,
        f"A call takes {ours[0]['p50_us']:.0f} µs; from {full:,} rays on it has full speed",
        f"Closest hits, {curve[0]['rays']} rays, {curve[0]['scene']},"
        f" {threads} thread{'s' * (threads > 1)}; median per call",
    )
    ends = []
    for name in drawn:
        rows = [row for row in curve if row["contender"] == name]
        label, color = NAMES.get(name, (f"wive\n{name}", style.OURS if name == backend else "#54aeff"))
        axes.plot(
            [row["batch"] for row in rows], [row["mrays"] for row in rows], "o-", color=color, linewidth=2.2,
            markersize=5,
        )  # fmt: skip
        ends.append((rows[-1]["mrays"], label, color))
    style.logarithmic(axes)
    style.name_lines(axes, ends)
    style.scale(axes, "rays per call", "million rays per second")
    return figure
