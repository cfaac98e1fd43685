"""For how many hours does the sun shine on each place of real land on the shortest day, without clouds?

    python examples/sun_hours.py

Prints the least and the most and draws sun_hours.png. Matplotlib brings the elevations.
"""

import numpy as np
from meshes import land
from pictures import layer, save

import wive

LATITUDE, DECLINATION = np.radians(36.6), np.radians(-23.44)  # of the place; of the sun at the solstice
STEP = 0.25  # hours


def sun(time: float, latitude: float, declination: float) -> tuple[float, float, float]:
    """The direction to the sun, to the east, to the north and up, at a local solar time in hours."""
    turn = np.radians(15 * (time - 12))
    return (
        -np.cos(declination) * np.sin(turn),
        np.cos(latitude) * np.sin(declination) - np.sin(latitude) * np.cos(declination) * np.cos(turn),
        np.sin(latitude) * np.sin(declination) + np.cos(latitude) * np.cos(declination) * np.cos(turn),
    )


def sun_hours(scene: wive.Scene, places: np.ndarray, latitude: float, declination: float) -> np.ndarray:
    """(...,) hours of sun at places (...,3)."""
    hours = np.zeros(places.shape[:-1])
    for time in np.arange(0, 24, STEP):
        direction = sun(time, latitude, declination)
        if direction[2] > 0:
            hours += STEP * ~scene.occluded(places, direction)
    return hours


def main() -> None:
    """Print and draw the hours."""
    z, x, y = land(2)
    scene = wive.Scene.from_heightfield(z, x, y)
    heads = scene.vertices.reshape(*z.shape, 3) + np.array([0, 0, 1.8])
    hours = sun_hours(scene, heads, LATITUDE, DECLINATION)
    print(f"from {hours.min()} to {hours.max()} hours of sun")
    save(layer(z, hours, 2, 9, "hours", "inferno"), __file__)


if __name__ == "__main__":
    main()
