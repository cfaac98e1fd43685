"""The figure of `bench python`: how many times as fast a Python user's call is with wive."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row

SCENE = "wive.Scene"
CALLS = {
    "embreex run(output=1)": "closest hit: embreex",
    "trimesh intersects_location(multiple_hits=False)": "closest hit: trimesh",
    "Open3D cast_rays": "closest hit: Open3D",
    "wp.mesh_query_ray, CPU": "closest hit: Warp, CPU",
    'embreex run("OCCLUDED")': "any hit: embreex",
    "Open3D test_occlusions": "any hit: Open3D",
    "trimesh intersects_any": "any hit: trimesh",
    "trimesh intersects_location(multiple_hits=True)": "every hit: trimesh",
}


def draw(content: Row) -> Figure:
    """A bar per call of another library: its seconds over those of `wive.Scene` on most threads."""
    threads = max(row["threads"] for row in content["means"])
    means = {
        row["other"]: row["mean"] for row in content["means"]
        if (row["ours"], row["threads"]) == (SCENE, threads) and row["other"] in CALLS
    }  # fmt: skip
    calls = [call for call in CALLS if call in means]
    values = [means[call] for call in calls]
    figure, (axes,) = style.page(
        1.35 + 0.4 * len(calls),
        f"From Python, wive is {min(values):.1f} to {max(values):.1f} times as fast",
        f"NumPy in, NumPy out; wive and Open3D on {threads} threads, the others on the one they have;\n"
        "geometric mean over scenes and kinds of rays",
    )
    style.bars(
        axes, [CALLS[call] for call in calls], values, [f"{value:.1f}" for value in values],
        [style.OURS] * len(calls),
    )  # fmt: skip
    axes.axvline(1, color="white", linewidth=2)
    style.subject(axes, "their seconds over wive's (white line: 1)")
    return figure
