"""The rays of one query: the library of each array, and the check that all are on the scene's device."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wive._internal import arguments
from wive._internal.arrays import (
    NUMPY,
    NUMPY_TYPES,
    Library,
    WarpArrays,
    library_of,
    lies_on,
)
from wive._internal.host_arrays import place_of, to_numpy
from wive._internal.precision import FLOAT32, Floats, Real
from wive._internal.shapes import has_many_axes, shape_of

NAMES = ("origins", "directions", "tmin", "tmax")
Libraries = tuple[Library, Library, Library, Library]


class Rays(NamedTuple):
    """What a query was given, unconverted, the library of its answer, and the library of each array.

    `is_flat` unless there are more axes than (n,3): `ray_shapes.flat_rays` makes these flat.
    """

    origins: Any
    directions: Any
    tmin: Any
    tmax: Any
    library: Library
    libraries: Libraries
    is_flat: bool = True

    def numpy(self, real: Real = FLOAT32) -> tuple[Floats, Floats, Floats, Floats]:
        """Origins, directions, tmin and tmax as the core takes them; memory is shared if it can be."""
        if self.library is NUMPY:
            return arguments.rays(self.origins, self.directions, self.tmin, self.tmax, real)
        return arguments.rays(*self._on_host(), real)

    def are(self, dtype: np.dtype[Any]) -> bool:
        """Whether origins and directions were given in this dtype."""
        origins, directions, *_ = self._on_host()
        return np.asarray(origins).dtype == np.asarray(directions).dtype == dtype

    def _on_host(self) -> tuple[Any, Any, Any, Any]:
        given = zip(NAMES, self.libraries, self[:4], strict=True)
        origins, directions, tmin, tmax = (to_numpy(*one) for one in given)
        return origins, directions, tmin, tmax


ALL_NUMPY = NUMPY, NUMPY, NUMPY, NUMPY
# `Rays` of a tuple, in two thirds of the time that `Rays(...)` takes.
_of_numpy = functools.partial(tuple.__new__, Rays)


def rays_of_numpy(origins: Any, directions: Any, tmin: Any, tmax: Any) -> Rays:
    """Rays (n,3) of NumPy's arrays."""
    return _of_numpy((origins, directions, tmin, tmax, NUMPY, ALL_NUMPY, True))


def ray_count(*values: ArrayLike) -> int:
    """How many rays origins and directions, and what else, are for; 0 if they are no arrays of vectors."""
    leadings = []
    for value in values:
        library = library_of(value)
        try:
            *leading, columns = shape_of("", value, library)
        except (TypeError, ValueError):  # the query says what is wrong
            continue
        if columns == 3:
            leadings.append(leading)
    counts = [math.prod(leading) for leading in leadings if leading]
    return max(counts, default=min(1, len(leadings)))  # one vector alone is that of all rays


def check_rays(
    origins: ArrayLike,
    directions: ArrayLike,
    tmin: ArrayLike,
    tmax: ArrayLike,
    backend: str,
    device: str | None,
) -> Rays:
    """The rays, if they are arrays of one library on the scene's device.

    Numbers and vectors of shape (3,) may always be NumPy's. Raises TypeError or ValueError otherwise.
    """
    if (
        isinstance(origins, NUMPY_TYPES)
        and isinstance(directions, NUMPY_TYPES)
        and isinstance(tmin, NUMPY_TYPES)
        and isinstance(tmax, NUMPY_TYPES)
    ):
        if type(origins) is np.ndarray and type(directions) is np.ndarray:
            is_flat = origins.ndim < 3 > directions.ndim
        else:
            is_flat = not (has_many_axes(origins, NUMPY) or has_many_axes(directions, NUMPY))
        return _of_numpy((origins, directions, tmin, tmax, NUMPY, ALL_NUMPY, is_flat))
    values = origins, directions, tmin, tmax
    libraries = library_of(origins), library_of(directions), library_of(tmin), library_of(tmax)
    given = list(zip(NAMES, values, libraries, strict=True))
    foreign = [one for one in given if one[2] is not NUMPY]
    if not foreign:
        return Rays(*values, NUMPY, ALL_NUMPY, _are_flat(values, ALL_NUMPY))
    first, _, library = foreign[0]
    for name, value, other in given:
        if other.name != library.name and not (other is NUMPY and _is_shared(value)):
            raise TypeError(
                f"{first} and {name} must be arrays of one library, got {library.name} and {other.name}: "
                "convert one of them"
            )
    for name, value, other in foreign:
        check_place(name, place_of(name, other, value), backend, device)
    return Rays(*values, answering(libraries, library), libraries, _are_flat(values, libraries))


def _are_flat(values: tuple[Any, ...], libraries: Libraries) -> bool:
    return not any(map(has_many_axes, values[:2], libraries[:2]))


def _is_shared(value: Any) -> bool:
    """Whether a NumPy value is a number or one vector for all rays."""
    return np.ndim(value) == 0 or np.shape(value) == (3,)


def check_place(name: str, place: str | None, backend: str, device: str | None) -> None:
    if lies_on(place, device or "cpu"):
        return
    found = place or "a CUDA device"
    if device is None:
        raise ValueError(
            f"{name} must be in host memory for backend {backend!r}, got an array on {found}: "
            f"copy it to the host, or make the scene with device={(place or 'cuda:0')!r}"
        )
    raise ValueError(
        f"{name} must be on the scene's device {device}, got an array on {found}: "
        "copy it there, or make the scene on that device"
    )


def answering(libraries: Sequence[Library], first: Library) -> Library:
    """The library of the answer: among Warp arrays, the one whose arrays hold vectors."""
    for library in libraries[:2]:
        if isinstance(library, WarpArrays) and library.vectors:
            return library
    return first
