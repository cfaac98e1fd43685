"""The rays of one call: which library's arrays they are, and whether they lie where the scene traces."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments
from wive._internal.arrays import NUMPY, NUMPY_TYPES, Library, WarpArrays, library_of
from wive._internal.precision import FLOAT32, Real

FourArrays = tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]


class Rays(NamedTuple):
    """What a query was given, unconverted, and the library that its answer belongs to."""

    origins: Any
    directions: Any
    tmin: Any
    tmax: Any
    library: Library

    def numpy(self, real: Real = FLOAT32) -> FourArrays:
        """Origins, directions, tmin and tmax as the core takes them; memory is shared where it can be."""
        if self.library is NUMPY:
            return arguments.rays(self.origins, self.directions, self.tmin, self.tmax, real)

        def host(value: Any) -> Any:
            return library_of(value).to_numpy(value)

        origins, directions = host(self.origins), host(self.directions)
        return arguments.rays(origins, directions, host(self.tmin), host(self.tmax), real)


def check_rays(
    origins: ArrayLike,
    directions: ArrayLike,
    tmin: ArrayLike,
    tmax: ArrayLike,
    backend: str,
    device: str | None,
) -> Rays:
    """The rays, where they are arrays of one library that lie where the scene traces.

    Numbers and vectors of shape (3,) may always be NumPy's. Raises TypeError or ValueError otherwise.
    """
    if (
        isinstance(origins, NUMPY_TYPES)
        and isinstance(directions, NUMPY_TYPES)
        and isinstance(tmin, NUMPY_TYPES)
        and isinstance(tmax, NUMPY_TYPES)
    ):
        return Rays(origins, directions, tmin, tmax, NUMPY)
    named = {"origins": origins, "directions": directions, "tmin": tmin, "tmax": tmax}
    libraries = {name: library_of(value) for name, value in named.items()}
    foreign = {name: library for name, library in libraries.items() if library is not NUMPY}
    if not foreign:
        return Rays(origins, directions, tmin, tmax, NUMPY)
    first, library = next(iter(foreign.items()))
    for name, other in libraries.items():
        if other.name != library.name and not (other is NUMPY and _is_shared(named[name])):
            raise TypeError(
                f"{first} and {name} must be arrays of one library, got {library.name} and {other.name}: "
                "convert one of them"
            )
    for name, other in foreign.items():
        _check_device(name, other.device(named[name]), backend, device)
    return Rays(origins, directions, tmin, tmax, _answering(foreign))


def _is_shared(value: Any) -> bool:
    """Whether a NumPy value is a number or one vector for all rays."""
    return np.ndim(value) == 0 or np.shape(value) == (3,)


def _check_device(name: str, found: str | None, backend: str, device: str | None) -> None:
    if device is None and found != "cpu":
        place = found or "a CUDA device"
        raise ValueError(
            f"{name} must be in host memory for backend {backend!r}, got an array on {place}: "
            f"copy it to the host, or make the scene with device={(found or 'cuda:0')!r}"
        )
    if device is not None and found not in (device, None if device != "cpu" else device):
        raise ValueError(
            f"{name} must be on the scene's device {device}, got an array on {found or 'a CUDA device'}: "
            "copy it there, or make the scene on that device"
        )


def _answering(foreign: Mapping[str, Library]) -> Library:
    """The library of the answer: among Warp arrays, the one whose arrays hold vectors."""
    for name in ("origins", "directions"):
        library = foreign.get(name)
        if isinstance(library, WarpArrays) and library.vectors:
            return library
    return next(iter(foreign.values()))
