"""The default mesh of `wive render`: real terrain that comes with matplotlib."""

import math

import numpy as np
from numpy.typing import NDArray

from wive._internal.precision import Floats
from wive.camera import Camera

METRES_PER_DEGREE = 111_320.0
# The valleys are 800 m deep in 30 km of land: too little to see in a picture.
EXAGGERATION = 4.0


def terrain_mesh() -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """The Jacksboro fault, Tennessee: (138632,3) vertices in metres (east, north, up) and (275772,3) faces.

    Elevations are multiplied by 4. The data is `jacksboro_fault_dem.npz` among matplotlib's samples.
    Raises ImportError if matplotlib is missing.
    """
    try:
        from matplotlib import cbook
    except ImportError:
        raise ImportError(
            'the default scene comes with matplotlib: pip install "wive[render]", or name a mesh file'
        ) from None
    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as sample:
        elevation = sample["elevation"].astype(np.float64)
        # The file calls the northern edge ymin.
        latitude = math.radians(float(sample["ymin"] + sample["ymax"]) / 2)
        east_step = float(sample["dx"]) * METRES_PER_DEGREE * math.cos(latitude)
        north_step = float(sample["dy"]) * METRES_PER_DEGREE

    rows, columns = elevation.shape
    east, south = np.meshgrid(np.arange(columns) * east_step, np.arange(rows) * north_step)
    vertices = np.stack([east, -south, elevation * EXAGGERATION], axis=-1).reshape(-1, 3)

    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    north_west, north_east = index[:-1, :-1], index[:-1, 1:]
    south_west, south_east = index[1:, :-1], index[1:, 1:]
    triangles = [[north_west, south_west, north_east], [north_east, south_west, south_east]]
    faces = np.stack([np.stack(corners, axis=-1) for corners in triangles], axis=2)
    return vertices.astype(np.float32), faces.reshape(-1, 3)


def terrain_camera() -> Camera:
    """A view from the south along the fault, mountains to its left."""
    return Camera(eye=(21_500, -36_500, 13_500), target=(13_700, -15_500, 1_700), up=(0, 0, 1), fov=31)


# Colours of land by height, from the lowest place to the highest; linear RGB.
HEIGHTS = (0.0, 0.12, 0.3, 0.5, 0.7, 1.0)
LAND = (
    (0.10, 0.19, 0.05),  # meadows
    (0.19, 0.26, 0.07),
    (0.07, 0.15, 0.04),  # forests
    (0.16, 0.18, 0.07),
    (0.30, 0.24, 0.13),
    (0.48, 0.42, 0.33),
)


def terrain_colours(vertices: Floats) -> NDArray[np.float32]:
    """(v,3) linear colours of `terrain_mesh`, as of a map: green below and brown above."""
    height = vertices[:, 2].astype(np.float64)
    share = (height - height.min()) / np.ptp(height)
    land = np.stack([np.interp(share, HEIGHTS, [colour[k] for colour in LAND]) for k in range(3)], axis=1)
    return land.astype(np.float32)
