"""Which masts of a radio network see each other over real land?

    python examples/line_of_sight.py

Prints how many pairs do and draws line_of_sight.png. Matplotlib brings the elevations.
"""

import numpy as np
from matplotlib.figure import Figure
from meshes import land
from pictures import INK, ORANGE, bare, page, relief, save

import wive

BLOCKS, HEIGHT = 3, 10.0  # a mast on the highest place of each of BLOCKS x BLOCKS pieces; metres


def high_places(z: np.ndarray) -> np.ndarray:
    """(n,2) row and column of the highest place of each piece of the land."""
    found = []
    rows, columns = (np.linspace(0, size, BLOCKS + 1).astype(int) for size in z.shape)
    for i, j in np.ndindex(BLOCKS, BLOCKS):
        piece = z[rows[i] : rows[i + 1], columns[j] : columns[j + 1]]
        row, column = np.unravel_index(np.argmax(piece), piece.shape)
        found.append((rows[i] + row, columns[j] + column))
    return np.array(found)


def network(scene: wive.Scene, tops: np.ndarray) -> np.ndarray:
    """(n,n) whether the tops (n,3) of masts see each other; a mast sees itself."""
    one, other = np.broadcast_arrays(tops[:, None], tops[None])
    return scene.visible(one, other)


def draw(z: np.ndarray, places: np.ndarray, seen: np.ndarray) -> Figure:
    """The masts at their rows and columns (n,2), and a line per pair that sees each other."""
    figure = page()
    axes = bare(figure)
    axes.imshow(0.45 + 0.5 * relief(z), cmap="gray", vmin=0, vmax=1, aspect="auto")
    for i, j in zip(*np.nonzero(np.triu(seen, 1)), strict=True):
        axes.plot(*places[[i, j]].T[::-1], color=ORANGE, linewidth=1.4)
    axes.plot(*places.T[::-1], "^", color=INK, markersize=9)
    style = {"size": 12, "color": "black", "weight": "bold", "transform": axes.transAxes}
    axes.text(0.01, 0.02, f"orange: the masts of {HEIGHT:.0f} m see each other", **style)
    return figure


def main() -> None:
    """Put masts on high places, and draw what they see."""
    z, x, y = land()
    scene = wive.Scene.from_heightfield(z, x, y)
    places = high_places(z)
    tops = scene.vertices.reshape(*z.shape, 3)[tuple(places.T)] + [0, 0, HEIGHT]
    seen = network(scene, tops)
    masts = len(places)
    print(f"{np.triu(seen, 1).sum()} of {masts * (masts - 1) // 2} pairs of masts see each other")
    save(draw(z, places, seen), __file__)


if __name__ == "__main__":
    main()
