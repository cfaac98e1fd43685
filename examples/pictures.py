"""Pictures of the programs in this folder: a view of a mesh, relief, a scale, and the file."""

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure

import wive

SIZE = 6.4, 4.8  # inches, of 100 pixels
INK, FAINT, ORANGE, BLUE = "#30363d", "#57606a", "#d9480f", "#1d5c99"
Box = tuple[float, float, float, float]  # left, bottom, width and height, as shares of the picture


def page(size: tuple[float, float] = SIZE) -> Figure:
    """An empty picture."""
    return Figure(figsize=size)


def bare(figure: Figure, box: Box = (0, 0, 1, 1), title: str = "") -> Axes:
    """Axes without a frame."""
    axes = figure.add_axes(box)
    axes.axis("off")
    axes.set_title(title, size=10, color=INK, loc="left")
    return axes


def bar(figure: Figure, label: str, low: float, high: float, colors: str) -> None:
    """A scale at the right."""
    axes = figure.add_axes((0.87, 0.2, 0.025, 0.6))
    figure.colorbar(ScalarMappable(Normalize(low, high), colors), cax=axes)
    axes.set_title(label, size=10, color=INK, loc="left")
    axes.tick_params(labelsize=9, colors=INK)


def view(
    scene: wive.Scene, color: Callable[[wive.Hits], np.ndarray], camera: wive.Camera | None = None,
    width: int = 600, height: int = 480,
) -> np.ndarray:  # fmt: skip
    """(height,width,3) a picture by a lamp at the camera: colours (...,3) of hits, else white."""
    camera = camera or wive.Camera.showing(scene, up=(0, 0, 1), aspect=width / height)
    hits = scene.intersect(*camera.rays(2 * width, 2 * height))
    light = 0.45 + 0.55 * np.nan_to_num(hits.cosines())[..., None]
    picture = np.where(hits.mask[..., None], color(hits) * light, 1.0)
    return picture.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))  # four rays per pixel


def by_triangle(
    values: np.ndarray, low: float, high: float, colors: str
) -> Callable[[wive.Hits], np.ndarray]:
    """Colours of hits by a value per triangle."""
    table = mpl.colormaps[colors](Normalize(low, high)(values))[:, :3]
    return lambda hits: table[hits.prim]


def surface(
    scene: wive.Scene, values: np.ndarray, low: float, high: float, label: str, colors: str
) -> Figure:
    """A mesh coloured by a value per triangle, beside a scale."""
    figure = page()
    bare(figure, (0, 0, 0.9, 1)).imshow(view(scene, by_triangle(values, low, high, colors)))
    bar(figure, label, low, high, colors)
    return figure


def relief(z: np.ndarray) -> np.ndarray:
    """(rows, columns) light on the land from the north-west, from 0 to 1."""
    return np.asarray(LightSource(315, 35).hillshade(z, vert_exag=2, dx=130, dy=160))


def layer(z: np.ndarray, values: np.ndarray, low: float, high: float, label: str, colors: str) -> Figure:
    """Values over the relief of the land, beside a scale."""
    figure = page()
    axes = bare(figure, (0.01, 0.01, 0.84, 0.98))
    axes.imshow(relief(z), cmap="gray", vmin=0, vmax=1, aspect="auto")
    axes.imshow(values, cmap=colors, vmin=low, vmax=high, alpha=0.6, aspect="auto")
    bar(figure, label, low, high, colors)
    return figure


def save(figure: Figure, program: str) -> None:
    """Writes the picture of a program, given by its `__file__`, into the working folder."""
    path = Path(program).with_suffix(".png").name
    figure.savefig(path, dpi=100)
    print(f"wrote {path}")
