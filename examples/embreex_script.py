"""A script for embreex as it is, but for its imports: the shadow of a ball on the ground.

    python examples/embreex_script.py

Draws embreex_script.png, the ground from above.
"""

import numpy as np
from pictures import bare, page, save

from wive.embreex import rtcore_scene  # was: from embreex import rtcore_scene
from wive.embreex.mesh_construction import TriangleMesh  # was: from embreex.mesh_construction import ...


def ball(rings: int = 32) -> np.ndarray:
    """(f,3,3) the corners of a ball's triangles, of radius 1 around (0, 0, 2)."""
    steep, turn = np.meshgrid(np.linspace(0, np.pi, rings), np.linspace(0, 2 * np.pi, 2 * rings))
    x, y = np.sin(steep) * np.cos(turn), np.sin(steep) * np.sin(turn)
    points = np.stack([x, y, 2 + np.cos(steep)], axis=-1)
    a, b, c, d = (points[i : i - 1 or None, j : j - 1 or None] for i in (0, 1) for j in (0, 1))
    return np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, c, d), (a, d, b))])


def lit(towards_sun: tuple[float, float, float], side: int = 41) -> np.ndarray:
    """(side,side) whether the sun reaches the ground, from -4 to 4 along x and y."""
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, ball())
    x, y = np.meshgrid(np.linspace(-4, 4, side), np.linspace(-4, 4, side))
    origins = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(np.float32)
    directions = np.tile(np.array(towards_sun, np.float32), (len(origins), 1))
    return scene.run(origins, directions, query="OCCLUDED").reshape(side, side) == -1


def main() -> None:
    """Draw the shadow."""
    figure = page((6.4, 6.4))
    bare(figure).imshow(lit((0.7, 0.2, 1.0), side=641), cmap="gray", vmin=-0.6, vmax=1.1, origin="lower")
    save(figure, __file__)


if __name__ == "__main__":
    main()
