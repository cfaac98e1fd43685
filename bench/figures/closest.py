"""The figure of `bench closest`: closest points and insides against other libraries."""

from matplotlib.figure import Figure

from bench.figures import style
from bench.support.report import Row
from bench.support.timing import geometric_mean

KINDS = {"volume": "in the box", "surface": "near the surface"}
LIBRARIES = {"open3d": "Open3D", "trimesh": "trimesh"}


def draw(content: Row) -> Figure:
    """A bar per library and kind of points, and one for insides: their seconds over wive's."""
    names, values = [], []
    for library, shown in LIBRARIES.items():
        for kind, where in KINDS.items():
            found = [row[library] for row in content["rows"] if row["kind"] == kind and row.get(library)]
            if found:
                names.append(f"closest to points {where}: {shown}")
                values.append(geometric_mean(found))
    names += ["inside or outside: trimesh"] * len(content["contains"])
    values += [row["contains"] for row in content["contains"]]
    count = f"{min(values):.0f} to {max(values):.0f}" if len(values) > 1 else f"{values[0]:.1f}"
    figure, (axes,) = style.page(
        1.3 + 0.4 * len(names),
        f"Closest points and insides: {count} times as fast",
        "One core, NumPy in and out; closest points: geometric mean over scenes",
    )
    style.bars(axes, names, values, [f"{value:.1f}" for value in values], [style.OURS] * len(names))
    style.subject(axes, "their seconds over wive's")
    return figure
