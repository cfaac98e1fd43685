"""The figure of `bench paper`: gain of path tracing over Embree's single rays, per scene."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row

WAYS = {"tuned": "a batch", 1: "one ray at a time"}


def draw(content: Row) -> Figure:
    """A panel for batches and one for single rays, a bar per scene."""
    rows = content["rows"]
    accuracy = "watertight" if any(row["accuracy"] == "watertight" for row in rows) else "fast"
    kernel = rows[0]["kernel"]
    rows = [row for row in rows if (row["accuracy"], row["kernel"]) == (accuracy, kernel)]
    ways = [way for way in WAYS if any(row["in_flight"] == way for row in rows)] or [rows[0]["in_flight"]]
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    means = {
        row["in_flight"]: row["mean_gain"] for row in content["means"]
        if (row["accuracy"], row["kernel"]) == (accuracy, kernel)
    }  # fmt: skip
    said = [
        f"{percent(means[way])} {text}"
        for way, text in zip(ways, ("in batches", "with single rays"), strict=False)
    ]
    figure, panels = style.page(
        1.5 + 0.33 * len(scenes),
        "Path tracing against Embree:\n" + ", ".join(said),
        f"One core, kernel {kernel}, {accuracy}; shading included on both sides",
        columns=len(ways), sharex=True,
    )  # fmt: skip
    every = [row["gain"] for row in rows]
    for i, (way, axes) in enumerate(zip(ways, panels, strict=True)):
        gains = {row["scene"]: row["gain"] for row in rows if row["in_flight"] == way}
        values = [gains[scene] for scene in scenes]
        names = [name.replace("_", " ") if i == 0 else "" for name in scenes]
        style.bars(
            axes, names, values, [percent(value) for value in values],
            [style.OURS if value >= 0 else style.OTHER for value in values],
        )  # fmt: skip
        axes.axvline(0, color=style.THEIRS, linewidth=1.2)
        axes.set_xlim(min(0, *every) - 0.35 * max(every), 1.45 * max(every))
        style.subject(axes, WAYS.get(way, f"{way} in flight"))
    return figure


def percent(gain: float) -> str:
    """A gain with its sign; zero has none."""
    return f"{round(gain):+d} %" if round(gain) else "0 %"
