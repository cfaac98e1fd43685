"""Shapes of arrays of any library, in which vectors of Warp are rows of numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wive._internal.arrays import NUMPY, Library, WarpArrays
from wive._internal.scalars import unreadable

Shape = tuple[int, ...]


def has_many_axes(value: Any, library: Library) -> bool:
    """Whether vectors are given with more axes than (n,3); false for what is no array at all."""
    if library is NUMPY:
        return _axes(value) > 2
    try:
        return len(shape_of("", value, library)) > 2
    except TypeError:
        return False


def shape_of(name: str, value: Any, library: Library) -> Shape:
    """The array's shape; TypeError that names the argument if its library can't tell."""
    if library is NUMPY:
        return np.shape(value)
    found = getattr(value, "shape", None)
    if found is None:
        found = getattr(value, "__cuda_array_interface__", {}).get("shape")
    if found is None:
        try:
            found = np.shape(library.to_numpy(value))
        except Exception as error:  # libraries raise anything
            raise unreadable(name, value, error) from error
    return (*found, *getattr(getattr(value, "dtype", None), "_shape_", ()))


def reshaped(value: Any, library: Library, shape: Shape) -> Any:
    """The array with another shape, over the same memory if it is C-contiguous."""
    if isinstance(library, WarpArrays) or type(value).__module__.partition(".")[0] == "warp":
        of_vectors = len(getattr(value.dtype, "_shape_", ()))
        return value.contiguous().reshape(shape[: len(shape) - of_vectors])
    if hasattr(value, "reshape"):
        return value.reshape(shape)
    if hasattr(value, "__dlpack__"):
        return library.from_numpy(library.to_numpy(value).reshape(shape))
    return _ReshapedInterface(value, shape)


@dataclass(frozen=True)
class Leading:
    """A library's arrays of n rays in the shape that the rays had."""

    library: Library
    shape: Shape

    def __call__(self, array: Any) -> Any:
        """An array (n,...) with the leading shape in place of n."""
        tail = shape_of("results", array, self.library)[1:]
        return reshaped(array, self.library, (*self.shape, *tail))


class _ReshapedInterface:
    """An array's `__cuda_array_interface__` with another shape."""

    def __init__(self, array: Any, shape: Shape) -> None:
        self._array = array  # lives as long as what is made of this
        old = array.__cuda_array_interface__
        size = np.dtype(old["typestr"]).itemsize
        rows = [math.prod(old["shape"][axis + 1 :]) * size for axis in range(len(old["shape"]))]
        if old.get("strides") not in (None, tuple(rows)):
            raise ValueError(f"arrays of shape {old['shape']} must be C-contiguous: copy them")
        self.__cuda_array_interface__: dict[str, Any] = {**old, "shape": shape, "strides": None}


def _axes(value: Any) -> int:
    """The number of axes, of lists by their first elements, so that long ones take no time."""
    if isinstance(value, list | tuple):
        return 1 + (_axes(value[0]) if value else 0)
    shape = getattr(value, "shape", ())
    return len(shape) if isinstance(shape, tuple) else 0
