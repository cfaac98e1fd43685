"""The numbers of a scene: float64 if the vertices were given as an array of float64, else float32."""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

Precision = Literal["float32", "float64"]
Floats = NDArray[np.float32 | np.float64]


class Real:
    """A precision, float32 or float64: the dtype of vertices, rays, t and uv."""

    __slots__ = ("dtype", "limits", "name")

    def __init__(self, name: Precision) -> None:
        """Make the limits of most queries once: making them takes a third of the time of a one-ray query."""
        self.name: Precision = name
        self.dtype: np.dtype[Any] = np.dtype(name)
        self.limits = {value: _one(value, self.dtype) for value in (0.0, float("inf"))}

    def array(self, values: NDArray[Any]) -> Floats:
        """The values in this dtype, C-contiguous; not copied if they are so already."""
        if values.dtype is self.dtype and values.flags.c_contiguous and values.flags.aligned:
            return values
        with np.errstate(over="ignore"):
            return np.require(values, self.dtype, ["C", "A"])

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        """Copies and pickles are `FLOAT32` and `FLOAT64` themselves."""
        return real_named, (self.name,)


def _one(value: float, dtype: np.dtype[Any]) -> Floats:
    array = np.array([value], dtype)
    array.flags.writeable = False
    return array


FLOAT32, FLOAT64 = Real("float32"), Real("float64")


def real_of(values: ArrayLike) -> Real:
    """FLOAT64 for an array of float64; FLOAT32 for all else: other dtypes, lists, numbers."""
    dtype = getattr(values, "dtype", None)
    is_float64 = isinstance(dtype, np.dtype) and dtype.kind == "f" and dtype.itemsize == 8
    return FLOAT64 if is_float64 else FLOAT32


def real_named(name: DTypeLike) -> Real:
    """The precision meant by a dtype or its name; ValueError if there is none."""
    for real in (FLOAT32, FLOAT64):
        try:
            if name is not None and np.dtype(name) == real.dtype:
                return real
        except TypeError:
            break
    raise ValueError(f"dtype must be float32 or float64, got {name!r:.60}")


def float32_or_refused(vertices: NDArray[Any]) -> NDArray[Any]:
    """float64 vertices as float32 for accuracy "exact"; ValueError if that would round one of them.

    NaN is not refused here: construction names its index.
    """
    with np.errstate(over="ignore"):
        rounded = vertices.astype(np.float32)
    lossy = (rounded != vertices) & ~np.isnan(vertices)
    if lossy.any():
        row = int(np.argmax(lossy.any(axis=-1)))
        raise ValueError(
            "vertices must be float32 numbers for accuracy 'exact', "
            f"got vertices[{row}] = {vertices[row].tolist()}: "
            "round them with vertices.astype(np.float32), or use accuracy 'watertight'"
        )
    return rounded
