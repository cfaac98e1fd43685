"""How much of a part lies inside another, by counting random points inside both.

    python examples/contains.py
    python examples/contains.py part.stl other.stl

Prints volumes and draws contains.png, points in a slice of both. Without files they are two vases that
overlap. Open or overlapping meshes are taken as solids by their winding numbers.
"""

import argparse

import numpy as np
from matplotlib.figure import Figure
from meshes import vase
from pictures import BLUE, FAINT, ORANGE, page, save

import wive


def overlap(one: wive.Scene, other: wive.Scene, points: int = 1_000_000) -> tuple[float, float]:
    """The volume of one scene, and of what it has in common with another one."""
    low, high = one.bounds.astype(np.float64)
    places = np.random.default_rng(1).uniform(low, high, (points, 3))
    inside = one.contains(places, sign="winding")
    common = inside & other.contains(places, sign="winding")
    return inside.mean() * np.prod(high - low), common.mean() * np.prod(high - low)


def draw(one: wive.Scene, other: wive.Scene, points: int = 20_000) -> Figure:
    """Random points of the plane through the middle: in one part, in the other, in both."""
    low = np.minimum(one.bounds[0], other.bounds[0]).astype(np.float64)
    high = np.maximum(one.bounds[1], other.bounds[1]).astype(np.float64)
    places = np.random.default_rng(2).uniform(low, high, (points, 3))
    places[:, 1] = one.bounds[:, 1].mean()
    first, second = (scene.contains(places, sign="winding") for scene in (one, other))
    figure = page()
    axes = figure.add_axes((0.02, 0.02, 0.96, 0.9))
    axes.set_aspect("equal")
    axes.axis("off")
    for chosen, color in ((first & ~second, BLUE), (second & ~first, FAINT), (first & second, ORANGE)):
        axes.plot(*places[chosen][:, [0, 2]].T, ".", color=color, markersize=2.2, markeredgewidth=0)
    for x, (text, color) in zip(
        (0.1, 0.4, 0.7), (("in the one", BLUE), ("in both", ORANGE), ("in the other", FAINT)), strict=True
    ):
        figure.text(x, 0.94, text, size=13, weight="bold", color=color)
    return figure


def main() -> None:
    """Print what two parts have in common, and draw it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("meshes", nargs="*", help="two mesh files; default: two vases")
    paths = parser.parse_args().meshes
    if len(paths) not in (0, 2):
        parser.error("expected two mesh files or none")
    vertices, faces = vase(rings=60, sections=60)
    if paths:
        one, other = map(wive.Scene.from_file, paths)
    else:
        one, other = (wive.Scene(vertices + np.float32([x, 0, 0]), faces) for x in (0, 1.1))
    volume, common = overlap(one, other, 50_000)
    print(f"volume {volume:.4g}, of which {common / volume if volume else 0:.1%} inside the other part")
    save(draw(one, other), __file__)


if __name__ == "__main__":
    main()
