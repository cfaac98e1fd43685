"""An X-ray of a part: how much material is there along each ray, by every hit?

    python examples/xray.py
    python examples/xray.py part.stl

Prints the volume and draws xray.png. The mesh must be closed. Without a file the part is a vase.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from meshes import scene_of
from pictures import bar, bare, page, save

import wive

WIDTH, HEIGHT = 480, 480


def through(scene: wive.Scene, camera: wive.OrthographicCamera) -> np.ndarray:
    """(h,w) the way through the material: rays go in and out in turn, however many hits there are."""
    hits = scene.intersect_all(*camera.rays(WIDTH, HEIGHT))
    number = np.arange(len(hits.t)) - hits.offsets[hits.ray]  # of each hit along its ray
    ways = np.where(number % 2 == 0, -hits.t, hits.t)  # in, out, in, out
    return np.bincount(hits.ray, ways, minlength=len(hits)).reshape(HEIGHT, WIDTH)


def draw(found: np.ndarray) -> Figure:
    """The picture and its scale."""
    most = float(np.percentile(found[found > 0], 97))  # a floor that is seen along it is far more
    figure = page()
    bare(figure, (0.05, 0.02, 0.8, 0.96)).imshow(found, cmap="bone_r", vmin=0, vmax=most)
    bar(figure, "material", 0, most, "bone_r")
    return figure


def main() -> None:
    """Print the volume, and draw."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mesh", type=Path, nargs="?", help="a mesh file; default: a vase")
    scene = scene_of(parser.parse_args().mesh)
    low, high = scene.bounds.astype(np.float64)
    middle, size = (low + high) / 2, 1.1 * float((high - low).max())
    camera = wive.OrthographicCamera(middle - [0, size, 0], middle, up=(0, 0, 1), view_height=size)
    found = through(scene, camera)
    print(f"volume {found.sum() * (size / HEIGHT) ** 2:.4g}")
    save(draw(found), __file__)


if __name__ == "__main__":
    main()
