"""The same numbers as arrays of any dtype, memory order, stride, alignment and class."""

from collections.abc import Callable
from typing import Any

import numpy as np

Random = np.random.Generator
REAL = ("f2", "f4", "f8", "g", ">f4", ">f8", "i1", "i2", "i4", "i8", ">i4", "u1", "u2", "u4", "u8")
NOT_REAL = ("?", "c8", "S4", "U4", "O", "M8[s]", "m8[s]", "V8")


def odd_array(random: Random, numbers: np.ndarray) -> tuple[Any, np.ndarray | None]:
    """An array or list that holds these small integers, and its plain values; None if it can't mean any."""
    if random.random() < 0.1:
        return wrong(random, numbers), None
    array = numbers.astype(random.choice(REAL[:6] if (numbers < 0).any() else REAL))
    plain = array.astype(np.float64)
    for _ in range(random.integers(3)):
        layout: Callable[[Random, np.ndarray], np.ndarray] = random.choice(np.array(LAYOUTS, object))
        array = layout(random, array)
    return (array.tolist() if random.random() < 0.1 else array), plain


def wrong(random: Random, numbers: np.ndarray) -> Any:
    """What is no array of real numbers of this shape."""
    choice = random.integers(5)
    if choice == 0:
        return numbers.astype(np.int64).astype(random.choice(NOT_REAL))
    if choice == 1:
        return numbers[..., :2]
    if choice == 2:
        return numbers[None]
    return [[None] * 3, "abc"][choice - 3]


def strided(random: Random, array: np.ndarray) -> np.ndarray:
    """Every second or third row and column of a larger array."""
    steps = random.integers(1, 4, array.ndim)
    larger = np.full([n * int(step) for n, step in zip(array.shape, steps, strict=True)], 77).astype(
        array.dtype
    )
    view = larger[tuple(slice(None, None, int(step)) for step in steps)]
    view[...] = array
    return view


def backward(_: Random, array: np.ndarray) -> np.ndarray:
    """Rows that lie in memory from last to first."""
    return array[::-1].copy()[::-1]


def mirrored(_: Random, array: np.ndarray) -> np.ndarray:
    """Numbers of a row that lie in memory from last to first."""
    return array[..., ::-1].copy()[..., ::-1]


def inside(_: Random, array: np.ndarray) -> np.ndarray:
    """Rows between others of one array, as a batch of a larger one."""
    return np.concatenate([array, array, array])[len(array) : 2 * len(array)]


def fortran(_: Random, array: np.ndarray) -> np.ndarray:
    return np.asfortranarray(array)


def unaligned(_: Random, array: np.ndarray) -> np.ndarray:
    """An array that begins at an odd address."""
    memory = np.zeros(array.nbytes + 1, np.uint8)
    view = memory[1:].view(array.dtype).reshape(array.shape)
    view[...] = array
    return view


def read_only(_: Random, array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.flags.writeable = False
    return array


def subclass(_: Random, array: np.ndarray) -> np.ndarray:
    return array.view(Labelled)


def record(_: Random, array: np.ndarray) -> np.ndarray:
    """A field of a record array."""
    records = np.zeros(array.shape, [("tag", "u1"), ("value", array.dtype)])
    records["value"] = array
    field: np.ndarray = records["value"]
    return field


class Labelled(np.ndarray):
    """A subclass without a meaning of its own."""


LAYOUTS = (strided, backward, mirrored, inside, fortran, unaligned, read_only, subclass, record)
