"""Whether arrays that are about to be made fit into memory, which systems grant and then kill for."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from wive import _cpu

# Smaller arrays are not worth a call.
UNCHECKED_NUMBERS = 1 << 23


def expect_room(count: int, dtype: np.dtype[Any] | type[np.generic]) -> None:
    """Raise MemoryError if there is no memory for an array of `count` numbers."""
    if count > UNCHECKED_NUMBERS:
        _cpu.expect_memory(count * np.dtype(dtype).itemsize)


@contextmanager
def room_for(name: str) -> Iterator[None]:
    """Name the file in a MemoryError, which Python raises without a word."""
    try:
        yield
    except MemoryError as error:
        raise MemoryError(f"{name}: {str(error) or 'not enough memory'}") from None
