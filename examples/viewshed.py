"""Line of sight on real terrain: which land does a lookout see, the horizon there, and how much sky.

    python examples/viewshed.py

Prints shares and heights and draws viewshed.png: the land that is seen from the highest place. Matplotlib
brings the elevations.
"""

import numpy as np
from matplotlib.figure import Figure
from meshes import land
from pictures import bare, page, relief, save

import wive


def sees(scene: wive.Scene, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...,) whether nothing lies between places a and b (...,3) in the air; either may be (3,)."""
    return ~scene.occluded(a, np.subtract(b, a), tmax=1.0)


def viewshed(scene: wive.Scene, eye: np.ndarray, shape: tuple[int, int], above: float) -> np.ndarray:
    """(rows, columns) whether `eye` (3,) sees what stands so high above each height of the grid."""
    heads = scene.vertices.reshape(*shape, 3) + np.array([0, 0, above])
    return sees(scene, eye, heads) & np.isfinite(heads[..., 2])


def horizon(scene: wive.Scene, places: np.ndarray, azimuths: np.ndarray) -> np.ndarray:
    """(..., azimuths) elevations in degrees above which places (...,3) see the sky, by bisection.

    Azimuths are in degrees from north over east. Terrain has no overhangs: below what is blocked, all is.
    """
    turn = np.radians(azimuths)
    low = np.full((*places.shape[:-1], len(turn)), -90.0)
    high = -low
    origins = np.broadcast_to(places[..., None, :], (*low.shape, 3))
    for _ in range(30):
        middle = np.radians(low + high) / 2
        flat = np.cos(middle)
        d = np.stack([flat * np.sin(turn), flat * np.cos(turn), np.sin(middle)], axis=-1)
        blocked = scene.occluded(origins, d)
        low, high = np.where(blocked, (low + high) / 2, low), np.where(blocked, high, (low + high) / 2)
    return high


def sky_view(horizons: np.ndarray) -> np.ndarray:
    """(...,) the fraction of the sky's light that level ground receives, by its horizons (..., azimuths)."""
    return np.mean(np.cos(np.radians(np.clip(horizons, 0, 90))) ** 2, axis=-1)


def draw(z: np.ndarray, seen: np.ndarray) -> Figure:
    """The relief, warm where it is seen from the highest place."""
    light = relief(z)[..., None]
    gray, warm = 0.35 + 0.6 * light * np.ones(3), (0.3 + 0.7 * light) * np.array([1.0, 0.62, 0.25])
    figure = page()
    axes = bare(figure)
    axes.imshow(np.where(seen[..., None], warm, gray).clip(0, 1), aspect="auto")
    row, column = np.unravel_index(np.argmax(z), z.shape)
    style = {"size": 11, "color": "black", "weight": "bold"}
    axes.plot(column, row, "^", color="black", markersize=9)
    axes.annotate("lookout", (column, row), (6, -14), textcoords="offset points", **style)
    axes.text(0.01, 0.02, "orange: seen from there", transform=axes.transAxes, **style)
    return figure


def main() -> None:
    """Print and draw the land that the highest place of the Jacksboro fault in Tennessee sees."""
    z, x, y = land()
    scene = wive.Scene.from_heightfield(z, x, y)
    eye = scene.vertices[np.argmax(z)] + [0, 0, 10]  # on a tower of 10 m
    seen = viewshed(scene, eye, z.shape, above=1.8)
    valley = scene.vertices[np.argmin(z)] + [0, 0, 1.8]
    horizons = horizon(scene, valley, np.arange(0, 360, 5))
    height, sky = horizons.max(), sky_view(horizons)
    print(f"{100 * seen.mean():.1f} % of the land is seen from the highest place. At the lowest place the")
    print(f"horizon is up to {height:.1f} degrees high, and the sky view factor is {sky:.3f}.")
    save(draw(z, seen), __file__)


if __name__ == "__main__":
    main()
