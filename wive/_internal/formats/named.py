"""Errors of readers, with the file's name and on one line whatever the file holds."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from wive._internal.lines import one_line


@contextmanager
def named(name: str) -> Iterator[None]:
    """Put the file's name before what a reader raises, and silence NumPy about numbers that are not finite.

    `wive.meshfile` names a vertex that is not finite, if a triangle uses it.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except (ValueError, ImportError) as error:
        kind = ImportError if isinstance(error, ImportError) else ValueError
        text = str(error).removeprefix(f"{name}: ")
        raise kind(f"{name}: {one_line(text)}") from None
