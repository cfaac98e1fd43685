"""Rays as Warp arrays on the scene's device: checked, and sharing memory with the user's arrays."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from wive._internal import arguments
from wive._internal.arrays import NUMPY, WARP_NUMBERS, Library, library_of, lies_on
from wive._internal.distant import Traced
from wive._internal.interpolation import vertex_values_of
from wive._internal.points import Points, largest_distances
from wive._internal.precision import FLOAT32, Floats, Real
from wive._internal.rays import Rays
from wive.warp_kernels.lanes.precision import PRECISIONS, precision_of

# Limits that nearly every query has, made once per scene.
COMMON_LIMITS = (0.0, float("inf"))
# Warp arrays hold no more.
MOST_RAYS = 2**31 - 1


@dataclass(frozen=True)
class WarpRays:
    """Origins and directions (n,) vec3, tmin and tmax (1,) or (n,) float32, on one device.

    A float64 scene has vec3d and float64.
    """

    origins: Any
    directions: Any
    tmin: Any
    tmax: Any

    def __len__(self) -> int:
        """Number of rays."""
        return len(self.origins)


class RayLoader:
    """Turns what users pass into `WarpRays` of one precision on one device."""

    def __init__(self, device: str, real: Real = FLOAT32) -> None:
        """Make the common limits."""
        self.device = device
        self.precision = real.name
        self.numbers = real
        warp = PRECISIONS[real.name]
        self._real, self._vec3, self._bytes = warp.real, warp.vec3, 4 * warp.words
        self._common = {value: wp.full(1, value, dtype=self._real, device=device) for value in COMMON_LIMITS}

    def from_numpy(self, rays: Rays, arrays: Traced | None = None) -> WarpRays:
        """Rays checked as for every backend; copied only if the device is not the host.

        `arrays` are what `rays.numpy` returned, if it was asked before.
        """
        origins, directions, tmin, tmax = arrays or rays.numpy(self.numbers)
        if len(origins) > MOST_RAYS:
            raise ValueError(
                f"origins must be at most {MOST_RAYS} for backend 'warp', got {len(origins)}: "
                "pass fewer at a time"
            )
        return WarpRays(
            wp.array(origins, dtype=self._vec3, device=self.device, copy=False),
            wp.array(directions, dtype=self._vec3, device=self.device, copy=False),
            self._limit_of_numpy(tmin),
            self._limit_of_numpy(tmax),
        )

    def from_device(self, rays: Rays) -> WarpRays:
        """Arrays on this device and of the scene's type already; none of them goes through the host."""
        of_origins, of_directions, of_tmin, of_tmax = rays.libraries
        origins, one_origin = self._vectors("origins", rays.origins, of_origins)
        directions, one_direction = self._vectors("directions", rays.directions, of_directions)
        count = len(directions) if one_origin else len(origins)
        if not one_direction and len(directions) != count:
            raise ValueError(
                f"origins and directions must be equally many, got {count} and {len(directions)}"
            )
        return WarpRays(
            _view(origins, count, 0) if one_origin else origins,
            _view(directions, count, 0) if one_direction else directions,
            self._limit("tmin", rays.tmin, of_tmin, count),
            self._limit("tmax", rays.tmax, of_tmax, count),
        )

    def points(self, points: Points) -> tuple[Any, Any]:
        """Points (n,) vec3 and largest distances (1,) or (n,); NumPy's are copied to the device."""
        if points.library is NUMPY:
            rows, most = points.numpy(self.numbers)
            return wp.array(rows, dtype=self._vec3, device=self.device, copy=False), self._limit_of_numpy(
                most
            )
        rows, _ = self._vectors("points", points.points, points.libraries[0])
        if points.libraries[1] is NUMPY:
            largest_distances(points.max_distance, 1, self.numbers)
        return rows, self._limit("max_distance", points.max_distance, points.libraries[1], len(rows))

    def rays_along(self, origins: Any, direction: Floats) -> tuple[Any, Any, Any, Any]:
        """Origins (n,) vec3, one direction for all of them, and limits: from 0 on."""
        one = wp.full(1, self._vec3(*direction.tolist()), dtype=self._vec3, device=self.device)
        return origins, _view(one, len(origins), 0), *self._common.values()

    def directions(self, value: Any, count: int) -> Any:
        """(count,) vec3 of directions (count,3), or (3,) for all; NumPy's are copied to the device."""
        library = library_of(value)
        if library is NUMPY:
            rows = arguments.directions(value, count, self.numbers)
            if rows.strides[0] == 0:
                one = wp.array(rows[:1], dtype=self._vec3, device=self.device)
                return _view(one, count, 0)
            return wp.array(rows, dtype=self._vec3, device=self.device, copy=False)
        place = library.device(value)
        if not lies_on(place, self.device):
            raise ValueError(
                f"directions must be on the device of the hits, {self.device}, "
                f"got an array on {place or 'a CUDA device'}: copy it there"
            )
        array, shared = self._vectors("directions", value, library)
        if shared:
            return _view(array, count, 0)
        if len(array) != count:
            raise ValueError(
                f"directions must have shape ({count}, 3), one per hit, or (3,), got {(len(array), 3)}"
            )
        return array

    def vertex_values(self, value: Any, count: int) -> Any:
        """(count,) or (count,k) float32 or float64; NumPy's are copied to the device."""
        library = library_of(value)
        if library is NUMPY:
            return wp.array(vertex_values_of(value, count), device=self.device, copy=False)
        place = library.device(value)
        if not lies_on(place, self.device):
            raise ValueError(
                f"vertex_values must be on the device of the hits, {self.device}, "
                f"got an array on {place or 'a CUDA device'}: copy it there"
            )
        array = WARP_NUMBERS.from_warp(self._converted("vertex_values", value, library).contiguous())
        if array.ndim not in (1, 2) or len(array) != count:
            raise ValueError(
                f"vertex_values must have shape ({count},) or ({count}, k), one row per vertex, "
                f"got {_shape(array)}"
            )
        if array.dtype not in (wp.float32, wp.float64):
            raise _not_converted("vertex_values", "float32 or float64", wp.types.type_repr(array.dtype))
        return array

    def _vectors(self, name: str, value: Any, library: Library) -> tuple[Any, bool]:
        """(n,) vec3 and False, or the (1,) that all rays share and True."""
        if library is NUMPY:
            shared = arguments.vectors(name, value, self.numbers).tolist()
            return wp.full(1, self._vec3(*shared), dtype=self._vec3, device=self.device), True
        array = self._checked(name, value, library)
        if array.dtype is self._vec3 and array.ndim == 1:
            return array, False
        if array.dtype is self._vec3 or array.ndim not in (1, 2) or array.shape[-1] != 3:
            raise ValueError(
                f"{name} must have shape (n, 3), or (3,) if all rays share it, got {_shape(array)}"
            )
        rows = array if array.strides[-1] == self._bytes else array.contiguous()
        if array.ndim == 1:
            return _view(rows, 1, 0), True
        return _view(rows, len(rows), rows.strides[0]), False

    def _limit(self, name: str, value: Any, library: Library, count: int) -> Any:
        """(1,) or (count,) float32."""
        if type(value) is float and value in self._common:
            return self._common[value]
        if library is NUMPY:
            (number,) = arguments.limits(name, value, 1, self.numbers)
            return self._limit_of_numpy(np.array([number], self.precision))
        array = self._checked(name, value, library)
        if array.shape not in ((1,), (count,)) or array.dtype is not self._real:
            raise ValueError(
                f"{name} must be one number or have shape ({count},), one per ray, got shape {_shape(array)}"
            )
        return array

    def _limit_of_numpy(self, values: Floats) -> Any:
        if len(values) == 1 and float(values[0]) in self._common:
            return self._common[float(values[0])]
        if len(values) == 1:
            return wp.full(1, float(values[0]), dtype=self._real, device=self.device)
        return wp.array(values, dtype=self._real, device=self.device, copy=False)

    def _checked(self, name: str, value: Any, library: Library) -> Any:
        """The array as Warp's: of the scene's numbers or of vectors of three."""
        array = self._converted(name, value, library)
        if array.dtype in (self._vec3, self._real):
            return array
        raise _not_converted(name, self.precision, wp.types.type_repr(array.dtype))

    def _converted(self, name: str, value: Any, library: Library) -> Any:
        """The array as Warp's; TypeError for a type that Warp has no name for."""
        try:
            return library.to_warp(value, self.device)
        except (RuntimeError, TypeError, ValueError, BufferError):
            found: object = getattr(value, "dtype", "another type")
            raise _not_converted(name, self.precision, found) from None


def _not_converted(name: str, expected: str, found: object) -> TypeError:
    return TypeError(
        f"{name} must be {expected} on a Warp device, where nothing is converted, got {found}: "
        "convert it first"
    )


def as_vectors(array: Any) -> Any:
    """(n,2) or (n,3) numbers as (n,) vectors, over the same memory; others as they are."""
    vectors = {
        (2, wp.float32): wp.vec2, (3, wp.float32): wp.vec3,
        (2, wp.float64): wp.vec2d, (3, wp.float64): wp.vec3d,
    }  # fmt: skip
    dtype = vectors.get((array.shape[1], array.dtype))
    if dtype is None:
        return array
    view = wp.array(ptr=array.ptr, dtype=dtype, shape=(len(array),), device=array.device, copy=False)
    view._owner = array
    return view


def _view(array: Any, count: int, stride: int) -> Any:
    """`count` vectors of three over the same memory, `stride` bytes apart."""
    view = wp.array(
        ptr=array.ptr,
        dtype=PRECISIONS[precision_of(array)].vec3,
        shape=(count,),
        strides=(stride,),
        device=array.device,
        copy=False,
    )
    view._owner = array  # lives as long as the view
    return view


def _shape(array: Any) -> tuple[int, ...]:
    """The shape in the user's library: vectors are rows."""
    return (*array.shape, *getattr(array.dtype, "_shape_", ()))
