"""What pictures of recipes have in common: a page's variables, views of a mesh, scales."""

from __future__ import annotations

import contextlib
import io
import runpy
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("agg")
import matplotlib.pyplot as plt
import numpy as np
from layout import EDGE
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

import wive

ROOT = Path(__file__).resolve().parents[2]
SIZE = 6.4, 4.8  # inches, at 100 pixels

sys.path.append(str(ROOT / "tests"))
from support.pages import programs  # noqa: E402


def variables_of(page: str, number: int = 0) -> dict[str, Any]:
    """The variables of a page's program after it has run."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        path = Path(folder) / "program.py"
        path.write_text(programs(f"docs/{page}.md")[number], encoding="utf-8")
        return runpy.run_path(str(path))


def bare(figure: Figure, box: tuple[float, float, float, float] = (0, 0, 1, 1)) -> plt.Axes:
    """Axes without a frame."""
    ax = figure.add_axes(box)
    ax.axis("off")
    return ax


def bar(figure: Figure, label: str, low: float, high: float, colors: str) -> None:
    """A scale at the right."""
    ax = figure.add_axes((0.87, 0.2, 0.025, 0.6))
    scale = mpl.cm.ScalarMappable(Normalize(low, high), colors)
    figure.colorbar(scale, cax=ax)
    ax.set_title(label, size=10, color=EDGE, loc="left")
    ax.tick_params(labelsize=9, colors=EDGE)


def view(
    scene: wive.Scene, color: Callable[[wive.Hits], np.ndarray], eye: tuple[float, float, float]
) -> np.ndarray:
    """(960,1200,3) a shaded picture of the vase: colours (...,3) of hits, a lamp at the camera."""
    camera = wive.Camera(eye=eye, target=(0, 0, 1.45), up=(0, 0, 1), fov=38)
    hits = scene.intersect(*camera.rays(1200, 960))
    light = 0.45 + 0.55 * np.nan_to_num(hits.cosines())[..., None]
    return np.where(hits.mask[..., None], color(hits) * light, 1.0)


def smaller(picture: np.ndarray) -> np.ndarray:
    """Half as wide and high, each pixel the mean of four."""
    h, w = picture.shape[:2]
    return picture.reshape(h // 2, 2, w // 2, 2, -1).mean(axis=(1, 3))


def by_triangle(
    values: np.ndarray, low: float, high: float, colors: str
) -> Callable[[wive.Hits], np.ndarray]:
    """Colours by a value per triangle."""
    table = mpl.colormaps[colors](Normalize(low, high)(values))[:, :3]
    return lambda hits: table[hits.prim]
