"""Skies and suns: the light of a path-traced picture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments
from wive._internal.picture import Image

Float64 = NDArray[np.float64]


class Sky(NamedTuple):
    """Radiances, linear RGB: at the horizon and below, straight up, and of a white surface facing the sun."""

    horizon: tuple[float, float, float]
    zenith: tuple[float, float, float]
    sun: tuple[float, float, float]


# Chosen so that a gray surface in the sun is just below white, and one in the shade clearly visible.
SUN = (0.98, 0.92, 0.80)
NO_SUN = (0.0, 0.0, 0.0)
RADIANCES = {
    "day": Sky((0.62, 0.72, 0.82), (0.22, 0.38, 0.66), SUN),
    "cloudy": Sky((0.70, 0.72, 0.75), (1.0, 1.0, 1.0), NO_SUN),
    "white": Sky((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), NO_SUN),
    "black": Sky((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), NO_SUN),
}
# From the ground to the sun: from the left, a little behind the camera, and above.
SUNLIT_FROM = (-0.8, -0.25, 0.65)


def light_of(sky: str, sun: ArrayLike | None, frame: Float64, up: Float64) -> Image:
    """(5,3) light as `Look` has it, for a camera's frame (4,3), and `up`, a unit vector.

    If `sun` is None, a sky that has a sun has it on the left of the camera.
    """
    radiances = RADIANCES[sky]
    if sun is None:
        to_sun = SUNLIT_FROM @ np.stack([*_ground(frame, up), up])
    else:
        to_sun = arguments.vector("sun", sun)
        radiances = radiances._replace(sun=SUN)
    to_sun = to_sun / np.max(abs(to_sun))
    rows = up, radiances.horizon, radiances.zenith, to_sun / np.sqrt((to_sun**2).sum()), radiances.sun
    return np.array(rows, np.float32)


def up_of_frame(frame: Float64) -> Float64:
    """The axis that is nearest to the top of a picture: what is up if only the picture tells."""
    top = frame[3] / np.max(abs(frame[3]))
    axis = np.zeros(3)
    largest = int(np.argmax(abs(top)))
    axis[largest] = np.sign(top[largest])
    return axis


def _ground(frame: Float64, up: Float64) -> tuple[Float64, Float64]:
    """Unit vectors across `up`: to the right of the picture, and into it."""
    right = frame[2] / np.max(abs(frame[2]))
    right = right - (right @ up) * up
    if np.max(abs(right)) < 1e-6:  # `up` is at the picture's right
        right = np.cross(frame[1], up)
        right = right - (right @ up) * up
    right = right / np.linalg.norm(right)
    return right, np.cross(up, right)
