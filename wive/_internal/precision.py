"""The numbers of a scene: float64 if the vertices are an array of float64, else float32."""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive import _cpu
from wive._internal.room import expect_room
from wive._internal.scalars import shown

Precision = Literal["float32", "float64"]
Floats = NDArray[np.float32 | np.float64]


class Real:
    """The dtype of vertices, rays, t and uv, and whether vertices may be rounded to it.

    Accuracy "exact" rounds none: its answers are those for the mesh that was given.
    """

    __slots__ = ("dtype", "limits", "name", "rounds")

    def __init__(self, name: Precision, rounds: bool = True) -> None:
        """Make the limits of most queries once: making them takes a third of the time of a one-ray query."""
        self.name: Precision = name
        self.rounds = rounds
        self.dtype: np.dtype[Any] = np.dtype(name)
        self.limits = {value: _one(value, self.dtype) for value in (0.0, float("inf"))}

    def array(self, values: NDArray[Any]) -> Floats:
        """The values in this dtype, rounded, C-contiguous; not copied if they are so already."""
        if values.dtype is self.dtype and values.flags.c_contiguous and values.flags.aligned:
            return values
        expect_room(values.size, self.dtype)
        # The caller's floating-point environment would round otherwise. A signalling NaN is invalid to NumPy.
        with _cpu.DefaultFloats(), np.errstate(over="ignore", invalid="ignore"):
            return np.require(values, self.dtype, ["C", "A"])

    def taken(self, name: str, given: ArrayLike, values: NDArray[Any], rounding: str = "") -> Floats:
        """What `array` returns for `values`, the array made of the argument `name`, whose value is `given`.

        Raises ValueError if that rounds a number and this precision may not; `rounding` is how users may.
        """
        rounded = self.array(values)
        if not self.rounds and values.dtype != self.dtype:
            refuse_rounded(name, given, values, rounded, rounding)
        return rounded

    def __reduce__(self) -> tuple[Any, tuple[str, bool]]:
        """Copies and pickles are the constants below themselves."""
        return _constant, (self.name, self.rounds)


def _one(value: float, dtype: np.dtype[Any]) -> Floats:
    array = np.array([value], dtype)
    array.flags.writeable = False
    return array


FLOAT32, FLOAT64, EXACT = Real("float32"), Real("float64"), Real("float32", rounds=False)


def _constant(name: str, rounds: bool) -> Real:
    return EXACT if not rounds else real_named(name)


def real_of(dtype: np.dtype[Any], accuracy: str) -> Real:
    """The numbers of a scene whose vertices have this dtype."""
    if accuracy == "exact":
        return EXACT
    return FLOAT64 if dtype.kind == "f" and dtype.itemsize == 8 else FLOAT32


def real_named(name: DTypeLike) -> Real:
    """The precision meant by a dtype or its name; ValueError if there is none."""
    for real in (FLOAT32, FLOAT64):
        try:
            if name is not None and np.dtype(name) == real.dtype:
                return real
        except TypeError:
            break
    raise ValueError(f"dtype must be float32 or float64, got {shown(name)}")


def real_asked(name: DTypeLike, accuracy: str) -> Real:
    """The precision that a user asks for; ValueError if there is none, or not with this accuracy."""
    real = real_named(name)
    if real is FLOAT64 and accuracy == "exact":
        raise ValueError("dtype must be float32 for accuracy 'exact', got float64: leave one of them out")
    return real


def refuse_rounded(
    name: str, given: ArrayLike, values: NDArray[Any], rounded: Floats, rounding: str = ""
) -> None:
    """Raise ValueError if a number that the user gave differs from the one it was rounded to.

    NaN is kept: vertices that no face uses may be NaN.
    """
    # NumPy gives the numbers of lists and tables one dtype, which may round integers.
    exact = values if isinstance(given, np.ndarray) else np.asarray(given, object).reshape(values.shape)
    with _cpu.DefaultFloats(), np.errstate(over="ignore", invalid="ignore"):
        # Compared in the dtype of the values: comparing int64 to float32 would round once more.
        kept = (rounded.astype(exact.dtype) == exact) | np.isnan(rounded)
    if exact.dtype.kind in "iu":
        kept &= rounded <= np.nextafter(np.float32(np.iinfo(exact.dtype).max), np.float32(0))
    kept = np.atleast_1d(kept)
    if not kept.all():
        row = int(np.argmin(kept.reshape(len(kept), -1).all(axis=1)))
        place, number = (
            (name, given) if values.ndim == 0 else (f"{name}[{row}]", np.asarray(exact[row]).tolist())
        )
        in_place = f"{name}.astype(np.float32)" if values is exact else f"np.asarray({name}, np.float32)"
        raise ValueError(
            f"{name} must be float32 numbers for accuracy 'exact', got {place} = {number!s:.90}: "
            f"round them with {rounding or in_place}, or use accuracy 'watertight'"
        )
