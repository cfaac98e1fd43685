"""The points of one query, checked: of any leading shape, in the arrays of any library."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wive._internal import arguments
from wive._internal.arrays import NUMPY, Library, library_of
from wive._internal.host_arrays import place_of, to_numpy
from wive._internal.precision import Floats, Real
from wive._internal.ray_shapes import flattened, numeric_array
from wive._internal.rays import answering, check_place
from wive._internal.shapes import Leading, Shape, shape_of

NAMES = ("points", "max_distance")


class Points(NamedTuple):
    """What a query was given: points as (n,3), the largest distance as a number or (n,).

    `libraries`: of both; `library`: of the answer. `leading`: the points' leading shape; None if it was (n,).
    """

    points: Any
    max_distance: Any
    library: Library
    libraries: tuple[Library, Library]
    leading: Shape | None

    def numpy(self, real: Real) -> tuple[Floats, Floats]:
        """(n,3) and (1,) or (n,) in the scene's dtype; memory is shared if it can be."""
        given = zip(NAMES, self.libraries, self[:2], strict=True)
        points, most = (to_numpy(*one) for one in given)
        rows = arguments.vectors("points", points, real, may_be_one=False)
        return rows, largest_distances(most, len(rows), real)

    def on_host(self, real: Real) -> Points:
        """The same points as (n,3) of NumPy."""
        rows, most = self.numpy(real)
        return Points(rows, most if len(most) > 1 else float(most[0]), NUMPY, (NUMPY, NUMPY), None)

    def answer(self, array: Any) -> Any:
        """NumPy's array (n,...) as one of the points' library, in their shape."""
        return self.shaped()(self.library.from_numpy(array))

    def shaped(self) -> Callable[[Any], Any]:
        """A function that gives the library's arrays (n,...) the points' leading shape."""
        return _same if self.leading is None else Leading(self.library, self.leading)


def check_points(points: ArrayLike, max_distance: ArrayLike, backend: str, device: str | None) -> Points:
    """The points and the largest distance, if they are arrays of one library on the scene's device.

    A number for all points may always be NumPy's. Raises TypeError or ValueError otherwise.
    """
    values = points, max_distance
    libraries = library_of(points), library_of(max_distance)
    if libraries[0].name != libraries[1].name and not (libraries[1] is NUMPY and np.ndim(max_distance) == 0):
        names = " and ".join(library.name for library in libraries)
        raise TypeError(
            f"points and max_distance must be arrays of one library, got {names}: convert one of them"
        )
    for name, library, value in zip(NAMES, libraries, values, strict=True):
        if library is not NUMPY:
            check_place(name, place_of(name, library, value), backend, device)
    rows = numeric_array("points", points, libraries[0])
    shape = shape_of("points", rows, libraries[0])
    if shape == (0,) and libraries[0] is NUMPY:
        shape, rows = (0, 3), np.reshape(rows, (0, 3))
    if shape[-1:] != (3,):
        raise ValueError(f"points must have shape (..., 3), one point per row, got {shape}")
    leading = shape[:-1]
    rows = rows if len(shape) == 2 else flattened(rows, libraries[0], shape, (3,), at_least_one=True)
    most = max_distance
    if len(leading) > 1:
        most = numeric_array("max_distance", most, libraries[1])
        given = shape_of("max_distance", most, libraries[1])
        if given not in ((), leading):
            raise ValueError(
                f"max_distance must be one number or have shape {leading}, one per point, got shape {given}"
            )
        most = flattened(most, libraries[1], given, ())
    library = answering(libraries, libraries[0])
    return Points(rows, most, library, libraries, leading if len(leading) > 1 else None)


def largest_distances(value: Any, count: int, real: Real) -> Floats:
    """(1,) or (count,) distances in the scene's dtype; ValueError for one that is negative or NaN."""
    most = arguments.limits("max_distance", value, count, real, "point")
    wrong = ~(most >= 0)
    if wrong.any():
        i = int(np.argmax(wrong))
        place = "" if np.ndim(value) == 0 else f"max_distance[{i}] = "
        raise ValueError(f"max_distance must be 0 or more, np.inf for no limit, got {place}{most[i]}")
    return most


def _same(array: Any) -> Any:
    return array
