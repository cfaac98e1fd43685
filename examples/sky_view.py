"""How much of the sky's light does level ground receive at each place of real land?

    python examples/sky_view.py

Prints the least and the most and draws sky_view.png. Matplotlib brings the elevations.
"""

import numpy as np
from meshes import land
from pictures import layer, save

import wive


def sky_view(scene: wive.Scene, places: np.ndarray, directions: int = 200) -> np.ndarray:
    """(...,) sky view factors of places (...,3), by directions as dense as the light on level ground."""
    random = np.random.default_rng(1)
    azimuth, up = random.uniform(0, 2 * np.pi, directions), np.sqrt(random.uniform(0, 1, directions))
    flat = np.sqrt(1 - up**2)
    free = np.zeros(places.shape[:-1])
    for direction in np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up], axis=1):
        free += ~scene.occluded(places, direction)
    return free / directions


def main() -> None:
    """Print and draw the factors."""
    z, x, y = land(2)
    scene = wive.Scene.from_heightfield(z, x, y)
    heads = scene.vertices.reshape(*z.shape, 3) + np.array([0, 0, 1.8])
    found = sky_view(scene, heads)
    print(f"sky view factors from {found.min():.2f} to {found.max():.2f}")
    save(layer(z, found, 0.9, 1, "sky", "cividis"), __file__)


if __name__ == "__main__":
    main()
