"""A car moves through a street: one mesh of a scene of two moves, the rest of the tree stays.

    python examples/moving.py

Prints how long a move takes and draws moving.png, three moments coloured by the mesh that is hit.
"""

import time

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from meshes import car, street
from pictures import ORANGE, bare, page, save, view

import wive

PLACES = -14, -3, 10  # of the car along the street


def moved(scene: wive.Scene, vertices: np.ndarray, x: float) -> None:
    """Puts the car, mesh 1 of the scene, to x."""
    scene.refit(vertices + np.float32([x, -1.5, 0]), geom=1)


def draw(scene: wive.Scene, vertices: np.ndarray) -> Figure:
    """A picture per place."""
    camera = wive.Camera(eye=(-34, -3, 16), target=(2, 0, 0), up=(0, 0, 1), fov=34)
    colors = np.array([(0.78, 0.8, 0.83), to_rgb(ORANGE)])
    figure = page((6.4, 2.3))
    for i, x in enumerate(PLACES):
        moved(scene, vertices, x)
        picture = view(scene, lambda hits: colors[hits.geom], camera, 420, 360)
        bare(figure, (0.005 + i * 0.333, 0.0, 0.32, 0.9), f"x = {x} m").imshow(picture)
    return figure


def main() -> None:
    """Move the car, and draw."""
    vertices, faces = car()
    scene = wive.Scene.from_meshes([street(), (vertices, faces)])
    figure = draw(scene, vertices)
    start = time.perf_counter()
    moved(scene, vertices, 0)
    print(f"a move takes {1e3 * (time.perf_counter() - start):.2f} ms")
    save(figure, __file__)


if __name__ == "__main__":
    main()
