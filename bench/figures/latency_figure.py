"""The figure of `bench latency`: time per call over batch size, and throughput over time per call."""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.figure import Figure

from bench.support.report import Row


def draw(curve: Sequence[Row]) -> Figure:
    """Left: microseconds per call over rays per call, p50 and p99. Right: Mray/s over those microseconds."""
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
    left.set_xlabel("rays per call")
    left.set_ylabel("microseconds per call: p50, dotted p99")
    right.set_xlabel("microseconds per call, p50")
    right.set_ylabel("Mray/s")
    for panel in (left, right):
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.grid(which="major", color="0.92", linewidth=0.8)
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"Closest hits, {curve[0]['rays']} rays, {curve[0]['scene']}", fontsize=10)
    left.legend(frameon=False, fontsize=8)
    return figure
