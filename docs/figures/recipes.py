"""Draws the pictures of the recipes: runs the programs that the pages print, and shows what they computed.

python docs/figures/recipes.py [NAME ...]

Writes recipe_NAME.png in docs/images. The picture of gradients needs PyTorch; it is left out without.
"""

from __future__ import annotations

import io
import runpy
import sys
from collections.abc import Callable
from importlib.util import find_spec

import matplotlib.pyplot as plt
import numpy as np
from layout import EDGE, FAINT
from matplotlib.colors import LightSource, to_rgb
from matplotlib.figure import Figure
from PIL import Image
from shown import ROOT, SIZE, bar, bare, by_triangle, smaller, variables_of, view

import wive

IMAGES = ROOT / "docs" / "images"
ORANGE, BLUE = "#d9480f", "#1d5c99"


def vase(color: Callable[[wive.Hits], np.ndarray], scene: wive.Scene) -> tuple[Figure, plt.Axes]:
    """The vase beside a scale."""
    figure = plt.figure(figsize=SIZE)
    ax = bare(figure, (0, 0, 0.9, 1))
    ax.imshow(smaller(view(scene, color, (3.4, -4.2, 4.3))))
    return figure, ax


def measured_vase(name: str, colors: str, low: float, high: float, label: str) -> Figure:
    """Numbers of the page on parts, one per triangle of the vase."""
    part = variables_of("parts")
    figure, _ = vase(by_triangle(part[name], low, high, colors), part["scene"])
    bar(figure, label, low, high, colors)
    return figure


def thickness() -> Figure:
    """Walls of the vase."""
    return measured_vase("thickness", "viridis", 0.05, 0.2, "wall")


def undercut() -> Figure:
    """What neither half of a mould reaches."""
    part = variables_of("parts")
    colors = np.where(part["undercut"][:, None], to_rgb(ORANGE), (0.82, 0.84, 0.86))
    figure, ax = vase(lambda hits: colors[hits.prim], part["scene"])
    ax.text(20, 420, "undercut", size=13, weight="bold", color=ORANGE)
    ax.text(20, 446, "reached from", size=11, color=FAINT)
    ax.text(20, 466, "above or below", size=11, color=FAINT)
    return figure


def occlusion() -> Figure:
    """How open the vase's surface is."""
    return measured_vase("open_to_sky", "gray", 0, 1, "open")


def xray() -> Figure:
    """The way through the material."""
    through = variables_of("parts")["through"]
    most = float(np.percentile(through, 97))  # the floor, seen along it, is far more
    figure = plt.figure(figsize=SIZE)
    bare(figure, (0.05, 0.02, 0.8, 0.96)).imshow(through, cmap="bone", vmin=0, vmax=most)
    bar(figure, "material", 0, most, "bone")
    return figure


def land(name: str, colors: str, low: float, high: float, label: str) -> Figure:
    """Values over the relief of the land."""
    found = variables_of("terrain", 1)
    z = found["z"]
    relief = LightSource(315, 35).hillshade(z, vert_exag=2, dx=130, dy=160)
    figure = plt.figure(figsize=SIZE)
    ax = bare(figure, (0.01, 0.01, 0.84, 0.98))
    ax.imshow(relief, cmap="gray", vmin=0, vmax=1, aspect="auto")
    ax.imshow(found[name], cmap=colors, vmin=low, vmax=high, alpha=0.6, aspect="auto")
    bar(figure, label, low, high, colors)
    return figure


def viewshed() -> Figure:
    """What is seen from the highest place."""
    found = variables_of("terrain", 1)
    z, seen = found["z"], found["seen"]
    relief = LightSource(315, 35).hillshade(z, vert_exag=2, dx=130, dy=160)[..., None]
    gray = 0.35 + 0.6 * relief * np.ones(3)
    warm = (0.3 + 0.7 * relief) * np.array([1.0, 0.62, 0.25])
    figure = plt.figure(figsize=SIZE)
    ax = bare(figure)
    ax.imshow(np.where(seen[..., None], warm, gray).clip(0, 1), aspect="auto")
    row, column = np.unravel_index(np.argmax(z), z.shape)
    ax.plot(column, row, "^", color="black", markersize=9)
    style = {"size": 11, "color": "black", "weight": "bold"}
    ax.annotate("lookout", (column, row), (6, -14), textcoords="offset points", **style)
    ax.text(6, z.shape[0] - 6, "orange: seen from there", **style)
    return figure


def sun_hours() -> Figure:
    """Hours of sun."""
    return land("hours", "inferno", 2, 9, "hours")


def sky_view() -> Figure:
    """Sky view factors."""
    return land("sky", "cividis", 0.9, 1, "sky")


def lidar() -> Figure:
    """A turn of a lidar in the street of examples/lidar.py: range image and points from above."""
    scene = wive.Scene(*runpy.run_path(str(ROOT / "examples" / "lidar.py"))["street"]())
    pose = np.eye(4)
    pose[:3, 3] = 0, 1, 1.8
    turn = wive.SpinningLidar(elevations=np.linspace(20, -25, 64), azimuths=1200, pose=pose)
    hits = scene.intersect(*turn.rays(), tmin=0.5, tmax=60)
    ranges = np.where(hits.mask, hits.t, np.nan)
    figure = plt.figure(figsize=SIZE)
    ax = bare(figure, (0.02, 0.68, 0.96, 0.26))
    ax.imshow(ranges, aspect="auto", cmap="turbo_r", vmin=0, vmax=40)
    ax.set_title("range image: 64 beams, 1200 steps", size=10, color=EDGE, loc="left")
    ax = bare(figure, (0.02, 0.0, 0.96, 0.62))
    points = hits.points()[hits.mask]
    ax.scatter(*points[:, :2].T, s=0.25, c=hits.t[hits.mask], cmap="turbo_r", vmin=0, vmax=40, linewidths=0)
    ax.plot(0, 1, "o", color="black", markersize=5)
    ax.set_aspect("equal")
    ax.set_xlim(-44, 44)
    ax.set_ylim(-20, 20)
    ax.set_title("the points from above", size=10, color=EDGE, loc="left")
    return figure


def depth() -> Figure:
    """Depth, normals and triangle numbers of the pyramid."""
    found = variables_of("sensors")
    ranges = np.where(np.isfinite(found["depth"]), found["depth"], np.nan)
    normals = np.nan_to_num((found["normals"] + 1) / 2, nan=1.0)
    prims = np.where(found["triangles"] >= 0, found["triangles"], np.nan)
    rows, columns = (np.flatnonzero((found["triangles"] >= 0).any(axis=axis)) for axis in (1, 0))
    part = np.s_[rows[0] - 15 : rows[-1] + 15, columns[0] - 15 : columns[-1] + 15]
    figure = plt.figure(figsize=(6.4, 1.9))
    for i, (picture, colors, title) in enumerate(
        ((ranges, "viridis_r", "depth"), (normals, None, "normals"), (prims, "tab10", "triangles"))
    ):
        ax = bare(figure, (0.01 + i * 0.333, 0.01, 0.315, 0.86))
        ax.imshow(picture[part], cmap=colors)
        ax.set_title(title, size=10, color=EDGE, loc="left")
    return figure


def distance() -> Figure:
    """A slice of the signed distance of closest.md's tube."""
    scene = variables_of("closest")["scene"]
    x, z = np.meshgrid(np.linspace(-2, 2, 320), np.linspace(1.5, -1.5, 240))
    value = scene.signed_distance(np.stack([x, 0 * x + 1e-3, z], axis=-1))
    figure = plt.figure(figsize=SIZE)
    ax = bare(figure, (0.01, 0.01, 0.84, 0.98))
    ax.imshow(value, cmap="RdBu_r", vmin=-0.6, vmax=0.6, extent=(-2, 2, -1.5, 1.5), aspect="auto")
    ax.contour(x, z, value, levels=np.arange(0.2, 1.2, 0.2), colors=FAINT, linewidths=0.6)
    ax.contour(x, z, value, levels=[0], colors="black", linewidths=1.8)
    bar(figure, "distance", -0.6, 0.6, "RdBu_r")
    return figure


def moving() -> Figure:
    """A car that moves through the street of examples/lidar.py, coloured by which mesh is hit."""
    street = runpy.run_path(str(ROOT / "examples" / "lidar.py"))["street"]()
    corner = np.array([(x, y, z) for x in (-2, 2) for y in (-0.9, 0.9) for z in (0.2, 1.6)], np.float32)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4)]
    faces = np.array([f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))])
    scene = wive.Scene.from_meshes([street, (corner, faces)])
    camera = wive.Camera(eye=(-34, -3, 16), target=(2, 0, 0), up=(0, 0, 1), fov=34)
    colors = np.array([(0.78, 0.8, 0.83), to_rgb(ORANGE), (1, 1, 1)])
    figure = plt.figure(figsize=(6.4, 2.3))
    for i, x in enumerate((-14, -3, 10)):
        scene.refit(corner + np.float32([x, -1.5, 0]), geom=1)
        hits = scene.intersect(*camera.rays(840, 720))
        light = 0.55 + 0.45 * np.nan_to_num(hits.cosines(), nan=1.0)[..., None]
        bare(figure, (0.005 + i * 0.333, 0.0, 0.32, 1)).imshow(smaller(colors[hits.geom] * light))
    return figure


def gradients() -> Figure:
    """The way of the guess in warp.md's room."""
    found = variables_of("warp", 4)
    steps = np.array([step.numpy() for step in found["steps"]])
    ends = np.array([1.5, -0.8]) + found["beams"].numpy()[:, :2] * found["measured"].numpy()[:, None]
    figure = plt.figure(figsize=SIZE)
    ax = bare(figure, (0.02, 0.02, 0.96, 0.96))
    ax.add_patch(plt.Rectangle((-4, -3), 8, 6, fill=False, edgecolor=EDGE, linewidth=2))
    for end in ends:
        ax.plot([1.5, end[0]], [-0.8, end[1]], color="#e2e6ea", linewidth=0.8, zorder=0)
    ax.plot(*steps[:, :2].T, "-o", color=ORANGE, markersize=2.5, linewidth=1)
    ax.plot(1.5, -0.8, "*", color=BLUE, markersize=14)
    ax.annotate("guess", steps[0, :2], (-4, 8), textcoords="offset points", size=12, color=ORANGE)
    ax.annotate("scanner", (1.5, -0.8), (10, -14), textcoords="offset points", size=12, color=BLUE)
    ax.set_aspect("equal")
    return figure


def kernel() -> Figure:
    """The sky that the ground sees in examples/ambient_occlusion.py, by its kernel."""
    import warp as wp

    example = runpy.run_path(str(ROOT / "examples" / "ambient_occlusion.py"))
    scene = wive.Scene(*example["tower"](), device="cpu")
    steps = np.linspace(-5.75, 5.75, 160)
    above = np.stack([*np.meshgrid(steps, -steps), np.full((160, 160), 10.0)], axis=-1).reshape(-1, 3)
    places = scene.intersect(wp.array(above, dtype=wp.vec3, device="cpu"), (0, 0, -1)).spawn((0, 0, 1))
    sky = wp.zeros(len(places), dtype=float, device="cpu")
    wp.launch(example["sky_seen"], len(places), inputs=[scene.tree.handle, places, sky], device="cpu")
    figure = plt.figure(figsize=SIZE)
    ax = bare(figure, (0.05, 0.02, 0.8, 0.96))
    ax.imshow(sky.numpy().reshape(160, 160), cmap="gray", vmin=0.4, vmax=1)
    bar(figure, "sky", 0.4, 1, "gray")
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {
    picture.__name__: picture
    for picture in (
        thickness, undercut, occlusion, xray, viewshed, sun_hours, sky_view, lidar, depth, distance, moving,
        gradients, kernel,
    )
}  # fmt: skip


def main() -> None:
    """Draw the pictures that are named, or all."""
    plt.rcParams["font.family"] = "DejaVu Sans"
    for name in sys.argv[1:] or PICTURES:
        if name == "gradients" and find_spec("torch") is None:
            print("recipe_gradients.png: left out, there is no PyTorch")
            continue
        data = io.BytesIO()
        figure = PICTURES[name]()
        figure.savefig(data, format="png", dpi=100)
        plt.close(figure)
        Image.open(data).convert("RGB").quantize(256, kmeans=1).save(
            IMAGES / f"recipe_{name}.png", optimize=True
        )


if __name__ == "__main__":
    main()
