"""A mesh and the rays that are traced through it."""

from typing import NamedTuple

import numpy as np


class Batch(NamedTuple):
    """A mesh, rays (n,3), and their limits, of one element or n."""

    vertices: np.ndarray
    faces: np.ndarray
    origins: np.ndarray
    directions: np.ndarray
    tmin: np.ndarray
    tmax: np.ndarray
