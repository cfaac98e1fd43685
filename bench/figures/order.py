"""The figure of `bench order`: nodes visited and speed of five orders of a node's children."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row

NAMES = {
    "distance": "sorted by distance",
    "treelet": "stored, by treelet (wive)",
    "diagonal": "stored, by diagonal",
    "slots": "slots by octant",
    "none": "no order",
}


def draw(content: Row) -> Figure:
    """Bars of means over scenes: steps more than in the order of distance, and speed over treelet order."""
    kind = content["means"][-1]["rays"]
    nodes = {row["order"]: row["nodes_vs_distance"] for row in content["means"] if row["rays"] == kind}
    flight = content["speed_means"][-1]["in_flight"]
    speed = {
        row["order"]: row["speed"] for row in content["speed_means"]
        if (row["rays"], row["in_flight"]) == (kind, flight)
    }  # fmt: skip
    more, faster = 100 * (nodes["treelet"] - 1), 100 * (speed["treelet"] / speed["distance"] - 1)
    figure, (left, right) = style.page(
        3.3,
        f"The stored order takes {more:.1f} % more steps than sorting,\nand is {faster:.0f} % faster",
        f"Geometric mean over scenes, {kind} rays, one tree for all orders; speed in a batch",
        columns=2,
    )  # fmt: skip
    colors = [style.OURS if order == "treelet" else style.THEIRS for order in NAMES]
    extra = [100 * (nodes[order] - 1) for order in NAMES]
    style.bars(left, list(NAMES.values()), extra, [f"{value:.1f} %" for value in extra], colors)
    values = [speed[order] for order in NAMES]
    style.bars(right, [""] * len(NAMES), values, [f"{value:.2f}" for value in values], colors)
    left.set_xlim(right=1.35 * max(*extra, 1))
    style.subject(left, "more inner nodes")
    style.subject(right, "speed, 1 = wive")
    return figure
