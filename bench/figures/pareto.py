"""The figure of `bench pareto`: speed against rays that leak, with a band of its own for none."""

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from bench.figures import style
from bench.support.report import Row

# What is drawn, and its names; compressed nodes find the same hits as "watertight".
NAMES = {
    "fast": "wive fast",
    "float64": "wive float64",
    "exact": "wive exact",
    "watertight": "wive watertight",
    "embree fast": "Embree, default",
    "embree robust": "Embree robust",
    "mesh_query_ray": "Warp",
}
BAND = "#dafbe1"


def draw(content: Row) -> Figure:
    """Above: contenders that leak, at their speed and share of leaks. Below: those that never do."""
    means = {row["contender"]: row for row in content["means"] if row["contender"] in NAMES}
    figure, (leaking, tight) = style.page(
        4.6, message(content, means), note(content), rows=2, sharex=True,
        heights=(3.4, 1.2),
    )  # fmt: skip
    rates = [row["leaks"] for row in means.values() if row["leaks"] > 0]
    leaking.set_yscale("log")
    leaking.set_ylim(min([*rates, 1e-3]) / 2, 0.5)
    leaking.set_yticks([10.0**power for power in range(-6, 0) if 10.0**power >= min([*rates, 1e-3]) / 2])
    leaking.yaxis.set_minor_locator(NullLocator())
    leaking.yaxis.set_major_formatter(FuncFormatter(lambda rate, _: f"{100 * rate:g} %"))
    style.subject(leaking, "rays aimed at edges and vertices that leak")
    tight.set_facecolor(BAND)
    tight.grid(visible=False)
    tight.set_yticks([0], ["none"], weight="bold")
    tight.set_ylim(-1, 1)
    style.scale(tight, "million rays per second, one core")
    fastest = max(row["mrays"] for row in means.values())
    tight.set_xlim(0, 1.32 * fastest)
    dry = sorted((row["mrays"], name) for name, row in means.items() if row["leaks"] == 0)
    for name, row in means.items():
        color = style.THEIRS if name not in ("fast", "watertight", "exact", "float64") else style.OURS
        axes, y = (leaking, row["leaks"]) if row["leaks"] > 0 else (tight, 0)
        axes.plot(row["mrays"], y, "o", color=color, markersize=11, clip_on=False, zorder=4)
        offset, ha = (10.0, 0.0), "left"
        if (row["mrays"], name) in dry[1:-1]:
            offset, ha = (0.0, 16.0), "center"
        elif len(dry) > 1 and (row["mrays"], name) == dry[0]:
            offset, ha = (-10.0, 0.0), "right"
        style.name_point(
            axes, row["mrays"], y, NAMES[name], style.FAINT if color == style.THEIRS else color, offset, ha
        )
    return figure


def message(content: Row, means: dict[str, Row]) -> str:
    """How many rays leak in "watertight", and its speed."""
    mine = [row for row in content["rows"] if row["contender"] == "watertight"]
    aimed = sum(row["aimed"] for row in mine)
    leaks = round(sum(row["leaks"] * row["aimed"] for row in mine))
    text = f"wive watertight: {leaks:,} of {aimed:,} rays leak"
    if "embree robust" in means:
        ratio = means["watertight"]["mrays"] / means["embree robust"]["mrays"]
        text += f",\nat {ratio:.1f} times the speed of Embree robust"
    return text


def note(content: Row) -> str:
    """What was measured."""
    return f"A closed sphere of {content['triangles']:,} triangles at ten sizes and places, rays from inside"
