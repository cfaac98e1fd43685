"""Wall thickness and volume of a casing, by trimesh with the rays of wive.

    python examples/wall_thickness.py

Prints the thinnest wall, the share of the surface behind which the wall is thinner than 3, and the volume,
and draws wall_thickness.png, the samples of the surface.
"""

import numpy as np
import trimesh
from matplotlib.figure import Figure
from pictures import bar, page, save

import wive


def casing() -> trimesh.Trimesh:
    """A box of 40 x 30 x 20 with a cavity of 32 x 22 x 12: the walls are from 2 to 6 thick."""
    box, cavity = trimesh.creation.box((40, 30, 20)), trimesh.creation.box((32, 22, 12))
    cavity.apply_translation((2, -1, 2))
    cavity.invert()
    return box + cavity


def draw(points: np.ndarray, thickness: np.ndarray) -> Figure:
    """The samples, opened along y: what lies behind the middle, coloured by the wall there."""
    back = points[:, 1] > 0
    figure = page()
    axes = figure.add_axes((-0.08, -0.12, 1.02, 1.24), projection="3d")
    axes.set_axis_off()
    axes.set_box_aspect((40, 30, 20))
    axes.view_init(elev=18, azim=-68)
    shown = points[back]
    axes.scatter(*shown.T, c=thickness[back], s=2.5, linewidths=0, cmap="viridis", vmin=2, vmax=6)
    bar(figure, "wall", 2, 6, "viridis")
    return figure


def main() -> None:
    """Sample the surface and the space around it."""
    wive.trimesh.install()
    mesh = casing()
    points, faces = trimesh.sample.sample_surface(mesh, 50_000, seed=1)
    thickness = trimesh.proximity.thickness(mesh, points, normals=mesh.face_normals[faces], method="ray")
    places = np.random.default_rng(1).uniform(*mesh.bounds, (500_000, 3))
    volume = mesh.contains(places).mean() * np.prod(mesh.extents)
    print(f"thinnest wall {thickness.min():.3f}, thinner than 3: {(thickness < 3).mean():.1%} of the surface")
    print(f"volume {volume:.0f} by points inside, {mesh.volume:.0f} by the divergence theorem")
    save(draw(points, thickness), __file__)


if __name__ == "__main__":
    main()
