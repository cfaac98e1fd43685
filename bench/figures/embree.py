"""The figure of `bench embree`: speed over Embree's robust mode, in a batch and one ray at a time."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row
from bench.support.timing import geometric_mean

KINDS = {
    "primary": "camera rays",
    "diffuse": "diffuse bounces",
    "random": "random rays",
    "shadow": "shadow rays",
}
WAYS = {"tuned": "a batch, as Python passes it", 1: "one ray at a time"}


def draw(content: Row) -> Figure | None:
    """A panel per way, a row per kind of rays: a dot per scene, and the geometric mean."""
    if not content["speed"]:
        return None
    first = content["speed"][0]
    accuracy = "watertight" if any(r["accuracy"] == "watertight" for r in content["speed"]) else "fast"
    speed = [
        row for row in content["speed"]
        if (row["accuracy"], row["kernel"], row["nodes"]) == (accuracy, first["kernel"], first["nodes"])
    ]  # fmt: skip
    ways = [way for way in WAYS if any(row["in_flight"] == way for row in speed)] or [first["in_flight"]]
    kinds = [kind for kind in KINDS if any(row["rays"] == kind for row in speed)]
    overall = [geometric_mean([row["ratio"] for row in speed if row["in_flight"] == way]) for way in ways]
    theirs = "Embree robust" if accuracy == "watertight" else "Embree"
    parts = zip(overall, ("in batches", "one ray at a time"), strict=False)
    message = f"Speed over {theirs}:\n" + ", ".join(f"{mean:.2f} {way}" for mean, way in parts)
    scenes = len({row["scene"] for row in speed})
    figure, panels = style.page(
        1.2 + 2.3 * len(ways), message,
        f"One core, {first['isa'].upper()}, {accuracy}; light: each of {scenes} scenes, dark: geometric mean",
        rows=len(ways), sharex=True,
    )  # fmt: skip
    for way, axes in zip(ways, panels, strict=True):
        ratios = {
            KINDS[kind]: [row["ratio"] for row in speed if (row["rays"], row["in_flight"]) == (kind, way)]
            for kind in kinds
        }
        style.spreads(axes, ratios)
        style.subject(axes, WAYS.get(way, f"{way} rays in flight"))
    panels[-1].set_xlim(left=0)  # of all panels, when each has its dots
    style.scale(panels[-1], f"speed, 1 = {theirs}")
    return figure
