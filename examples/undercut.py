"""Which triangles of a part does neither half of a mould reach, that opens upwards and downwards?

    python examples/undercut.py
    python examples/undercut.py part.stl --up 0 1 0

Prints the share of the surface and draws undercut.png. Without a file the part is a vase.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from meshes import scene_of
from pictures import FAINT, ORANGE, bare, page, save, view

import wive


def undercut(scene: wive.Scene, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(f,) whether a triangle can be pulled neither along `up` (3,) nor against it, and (f,) areas."""
    corners = scene.vertices[scene.faces].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    triangles, middle = np.arange(len(scene)), (1 / 3, 1 / 3)
    reached = np.zeros(len(scene), bool)
    for way in (up, -up):
        free = ~scene.occluded(scene.spawn(triangles, middle, way), way)
        reached |= free & (normals @ way > 0)
    return ~reached, np.linalg.norm(normals, axis=1) / 2


def draw(scene: wive.Scene, found: np.ndarray) -> Figure:
    """The part, undercuts in orange."""
    colors = np.where(found[:, None], to_rgb(ORANGE), (0.82, 0.84, 0.86))
    figure = page()
    axes = bare(figure, (0, 0, 0.9, 1))
    axes.imshow(view(scene, lambda hits: colors[hits.prim]))
    axes.text(20, 420, "undercut", size=13, weight="bold", color=ORANGE)
    axes.text(20, 446, "reached from", size=11, color=FAINT)
    axes.text(20, 466, "above or below", size=11, color=FAINT)
    return figure


def main() -> None:
    """Print and draw the undercuts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", type=Path, nargs="?", help="a mesh file; default: a vase")
    parser.add_argument("--up", type=float, nargs=3, default=(0, 0, 1), help="how the mould opens")
    arguments = parser.parse_args()
    scene = scene_of(arguments.mesh)
    found, areas = undercut(scene, np.array(arguments.up, np.float64))
    print(f"{areas[found].sum() / areas.sum():.0%} of the surface is undercut")
    save(draw(scene, found), __file__)


if __name__ == "__main__":
    main()
