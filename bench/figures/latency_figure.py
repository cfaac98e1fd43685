"""The figure of `bench latency`: what a call costs as batches grow, and the throughput that buys."""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.figure import Figure

from bench.support.report import Row


def draw(curve: Sequence[Row]) -> Figure:
    """Left: seconds of a call over rays a call, the median and its 99th percentile. Right: what it yields."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    for i, name in enumerate(dict.fromkeys(row["contender"] for row in curve)):
        rows = [row for row in curve if row["contender"] == name]
        batch, p50, p99, mrays = (
            [row[key] for row in rows] for key in ("batch", "p50_us", "p99_us", "mrays")
        )
        device = rows[0]["device"]
        label = name if device == "cpu" and not name.startswith("warp") else f"{name}, {device}"
        left.plot(batch, p50, marker="o", markersize=3, color=f"C{i}", label=label)
        left.plot(batch, p99, linestyle=":", linewidth=1, color=f"C{i}")
        right.plot(p50, mrays, marker="o", markersize=3, color=f"C{i}")
    left.set_xlabel("rays a call")
    left.set_ylabel("microseconds a call: p50, dotted p99")
    right.set_xlabel("microseconds a call, p50")
    right.set_ylabel("Mray/s")
    for panel in (left, right):
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.grid(which="major", color="0.92", linewidth=0.8)
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"Closest hits, {curve[0]['rays']} rays, {curve[0]['scene']}", fontsize=10)
    left.legend(frameon=False, fontsize=8)
    return figure
