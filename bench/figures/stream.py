"""The figure of `bench stream`: speed of rays that come from files over that of one batch in memory."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row
from bench.support.timing import geometric_mean

FORMS = {
    "read": "rays read from .npy",
    "npy to npz": "hits to .npz",
    "npz to npz": "rays of .npz, hits to .npz",
    "npy to folder": "hits to a folder of .npy",
    "npy to npz, one thread": "hits to .npz, traced on one thread",
    "all, npy to npz": "every hit to .npz",
    "all, npy to folder": "every hit to a folder of .npy",
}


def draw(content: Row) -> Figure:
    """A bar per form of files: the geometric mean over scenes."""
    means = {
        form: geometric_mean([row["ratio"] for row in content["rows"] if row["form"] == form])
        for form in FORMS
    }
    low, high = min(means.values()), max(means.values())
    figure, (axes,) = style.page(
        1.3 + 0.4 * len(means),
        f"Rays of files: {100 * low:.0f} to {100 * high:.0f} % of the speed in memory",
        f"All cores, {content['rays']:,} rays of files in the page cache; geometric mean over scenes",
    )
    style.bars(
        axes, list(FORMS.values()), list(means.values()), [f"{100 * mean:.0f} %" for mean in means.values()],
        [style.OURS] * len(means),
    )  # fmt: skip
    return figure
