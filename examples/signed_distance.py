"""How far is each place from a surface, and on which side of it? A slice of the signed distance.

    python examples/signed_distance.py
    python examples/signed_distance.py part.stl

Draws signed_distance.png: blue inside, red outside, a line every 20th of the height. The mesh must be closed.
Without a file the part is a vase.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from meshes import scene_of
from pictures import FAINT, bar, bare, page, save

import wive

WIDTH, HEIGHT = 400, 360


def slice_of(scene: wive.Scene) -> tuple[np.ndarray, np.ndarray]:
    """(h,w,3) places in the middle plane across y, with a margin, and (h,w) their distances."""
    low, high = scene.bounds.astype(np.float64)
    size = 1.3 * max(high[2] - low[2], (high[0] - low[0]) * HEIGHT / WIDTH)
    middle = (low + high) / 2
    x = middle[0] + np.linspace(-0.5, 0.5, WIDTH) * size * WIDTH / HEIGHT
    z = middle[2] + np.linspace(0.5, -0.5, HEIGHT) * size
    places = np.stack(np.broadcast_arrays(x, middle[1], z[:, None]), axis=-1)
    return places, scene.signed_distance(places)


def draw(places: np.ndarray, found: np.ndarray) -> Figure:
    """The slice, its lines of equal distance, and the surface in black."""
    x, z = places[..., 0], places[..., 2]
    step = float(np.ptp(z)) / 20
    figure = page()
    axes = bare(figure, (0.01, 0.01, 0.84, 0.98))
    frame = x.min(), x.max(), z.min(), z.max()
    axes.imshow(found, cmap="RdBu_r", vmin=-step, vmax=step, extent=frame, aspect="auto")
    levels = np.arange(1, int(found.max() / step) + 1) * step
    axes.contour(x, z, found, levels=levels, colors=FAINT, linewidths=0.6)
    axes.contour(x, z, found, levels=[0], colors="black", linewidths=1.8)
    bar(figure, "distance", -step, step, "RdBu_r")
    return figure


def main() -> None:
    """Draw the slice."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", type=Path, nargs="?", help="a mesh file; default: a vase")
    places, found = slice_of(scene_of(parser.parse_args().mesh))
    print(f"{(found < 0).mean():.1%} of the slice lies inside, the deepest place by {-found.min():.4g}")
    save(draw(places, found), __file__)


if __name__ == "__main__":
    main()
