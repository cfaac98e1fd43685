"""Draws docs/images/speeds.svg: rays per second from Python, of the libraries that `bench python` compares.

python docs/figures/speeds.py
"""

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "bench" / "results" / "python.json"
TARGET = ROOT / "docs" / "images" / "speeds.svg"

# The callers of closest hits in the bench, and what the bars say of them.
CALLERS = {
    "trimesh intersects_first": "trimesh with embreex",
    "wp.mesh_query_ray, CPU": "Warp, wp.mesh_query_ray, on the CPU",
    "embreex run(output=1)": "embreex",
    "Open3D cast_rays, all threads": "Open3D",
}
CLOSEST = "closest"
KIND = "diffuse"  # rays that a surface scatters
OURS, THEIRS, TEXT = "#0969da", "#afb8c1", "#30363d"


def mean(numbers: list[float]) -> float:
    """The geometric mean."""
    return float(np.exp(np.mean(np.log(numbers))))


def speeds(rows: list[dict[str, Any]]) -> list[tuple[str, float, str]]:
    """Names, million rays per second and colours of the bars, from the slowest to the fastest."""
    rows = [row for row in rows if row["rays"] == KIND and row["query"].startswith(CLOSEST)]
    bars = []
    for caller, name in CALLERS.items():
        found = [row["other_mrays"] for row in rows if row["other"] == caller and row["ours"] == "wive.Scene"]
        if found:
            bars.append((name, mean(found), THEIRS))
    full = [row for row in rows if row["query"] == "closest: t, prim, uv" and row["ours"] == "wive.Scene"]
    for threads in sorted({row["threads"] for row in full}):
        found = [row["wive_mrays"] for row in full if row["threads"] == threads]
        bars.append((f"wive, {threads} thread{'s' * (threads > 1)}", mean(found), OURS))
    return sorted(bars, key=lambda bar: bar[1])


def main() -> None:
    """Draw the figure."""
    content = json.loads(SOURCE.read_text(encoding="utf-8"))
    bars = speeds(content["rows"])
    mpl.rcParams["svg.hashsalt"] = "wive"
    figure, ax = plt.subplots(figsize=(7.4, 0.42 * len(bars) + 0.75), layout="constrained")
    names, values, colours = zip(*bars, strict=True)
    drawn = ax.barh(names, values, color=colours, height=0.7)
    ax.bar_label(drawn, labels=[f"{value:.1f}" for value in values], padding=4, color=TEXT)
    ax.set_title("Closest hits of scattered rays: million rays per second", loc="left", color=TEXT, size=11)
    ax.set_xlim(0, 1.12 * max(values))
    ax.set_xticks([])
    ax.tick_params(axis="y", length=0, labelcolor=TEXT)
    ax.spines[:].set_visible(False)
    figure.savefig(TARGET, metadata={"Date": None})


if __name__ == "__main__":
    main()
