"""Readers of the colours in mesh files, a module per format; `wive.colors` chooses one.

A reader is `read(data, name, folder)`: linear colours as float64, (v,3) of the vertices or (f,1,3) of the
triangles that the format's mesh reader returns, NaN if the file gives one none; or None if it has no colours.
"""

import numpy as np
from numpy.typing import NDArray

Colours = NDArray[np.float64]


def linear(values: NDArray[np.generic], most: float) -> Colours:
    """Linear colours of sRGB ones from 0 to `most`; what is out of range is cut off."""
    share = np.clip(values.astype(np.float64) / most, 0, 1)
    # IEC 61966-2-1.
    return np.asarray(np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4))


def linear_guessed(values: Colours) -> Colours:
    """Linear colours of sRGB ones from 0 to 1, or from 0 to 255 if any is above 1."""
    return linear(values, 255 if values.size and np.nanmax(values) > 1 else 1)


def of_triangles(polygons: Colours, sizes: NDArray[np.int64]) -> Colours:
    """(f,1,3) colours of the triangles that polygons of so many corners are cut into."""
    return np.repeat(polygons, np.maximum(sizes - 2, 0), axis=0)[:, None]
