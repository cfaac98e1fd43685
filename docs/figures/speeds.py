"""Draws docs/images/speeds.svg: rays per second from Python, of the libraries that `bench python` compares.

python docs/figures/speeds.py
"""

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "bench" / "results" / "python.json"
TARGET = ROOT / "docs" / "images" / "speeds.svg"

sys.path.append(str(ROOT))
from bench.figures import style  # noqa: E402

# The callers of closest hits in the bench, and what the bars say of them.
CALLERS = {
    "trimesh intersects_first": "trimesh with embreex",
    "wp.mesh_query_ray, CPU": "Warp, wp.mesh_query_ray, on the CPU",
    "embreex run(output=1)": "embreex",
    "Open3D cast_rays": "Open3D",
}
THREADED = {"Open3D cast_rays"}
CLOSEST = "closest"
KIND = "diffuse"  # rays that a surface scatters


def mean(numbers: list[float]) -> float:
    """The geometric mean."""
    return float(np.exp(np.mean(np.log(numbers))))


def per_threads(
    name: str, rows: list[dict[str, Any]], column: str, color: str
) -> list[tuple[str, float, str]]:
    """A bar per number of threads."""
    return [
        (
            f"{name}, {threads} thread{'s' * (threads > 1)}",
            mean([row[column] for row in rows if row["threads"] == threads]),
            color,
        )
        for threads in sorted({row["threads"] for row in rows})
    ]


def speeds(rows: list[dict[str, Any]]) -> list[tuple[str, float, str]]:
    """Names, million rays per second and colors of the bars, from the fastest to the slowest."""
    rows = [row for row in rows if row["rays"] == KIND and row["query"].startswith(CLOSEST)]
    bars = []
    for caller, name in CALLERS.items():
        found = [row for row in rows if row["other"] == caller and row["ours"] == "wive.Scene"]
        if caller in THREADED:
            bars += per_threads(name, found, "other_mrays", style.THEIRS)
        else:
            bars.append((name, mean([row["other_mrays"] for row in found]), style.THEIRS))
    full = [row for row in rows if row["query"] == "closest: t, prim, uv" and row["ours"] == "wive.Scene"]
    bars += per_threads("wive", full, "wive_mrays", style.OURS)
    return sorted(bars, key=lambda bar: -bar[1])


def main() -> None:
    """Draw the figure."""
    content = json.loads(SOURCE.read_text(encoding="utf-8"))
    bars = speeds(content["rows"])
    names, values, colors = zip(*bars, strict=True)
    mpl.rcParams["svg.hashsalt"] = "wive"
    figure, (axes,) = style.page(
        1.1 + 0.42 * len(bars),
        "Closest hits of scattered rays: million rays per second",
        "NumPy arrays in and out; trimesh, embreex and Warp use one thread; mean over four scenes",
    )
    style.bars(axes, names, values, [f"{value:.1f}" for value in values], colors)
    figure.savefig(TARGET, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
