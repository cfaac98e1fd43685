"""The figure of `bench interrupts`: how long Ctrl-C takes at most."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.groups import distinct
from bench.support.report import Row


def draw(content: Row) -> Figure:
    """A bar per kind of call or command: the longest of all tries and scenes."""
    rows = content["rows"]
    kinds = [kind for (kind,) in distinct(rows, "kind")]
    longest = [max(row["longest"] for row in rows if row["kind"] == kind) for kind in kinds]
    tries = sum(row["tries"] for row in rows)
    figure, (axes,) = style.page(
        1.3 + 0.33 * len(kinds),
        f"Ctrl-C takes {max(longest) / 1e3:.2f} s at most",
        f"Longest of {tries} tries at random moments, until KeyboardInterrupt or the end of the process",
    )
    texts = [f"{value / 1e3:.2f} s" for value in longest]
    style.bars(axes, kinds, longest, texts, [style.OURS] * len(kinds))
    return figure
