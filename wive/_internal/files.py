"""Output files that are whole or absent."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

PathLike = str | os.PathLike[str]


def check_output(path: PathLike, suffix: str = "") -> str:
    """Raise ValueError or OSError if `path` can't become a file that ends in `suffix`; return it as text.

    Call it before long work whose result is written there.
    """
    name = os.fspath(path)
    if not name.lower().endswith(suffix):
        raise ValueError(f"output file must end in {suffix}, got {name!r}")
    if os.path.exists(name) and not os.path.isfile(name):
        raise ValueError(f"output file {name!r} exists and is not an ordinary file: choose another name")
    folder = os.path.dirname(os.path.realpath(name))
    if not os.path.isdir(folder):
        raise FileNotFoundError(f"output folder {folder!r} does not exist: create it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"output folder {folder!r} is not writable")
    return name


@contextmanager
def atomic_write(path: PathLike) -> Iterator[BinaryIO]:
    """An open binary file that becomes `path` when the block ends, and vanishes if it raises."""
    final = os.path.realpath(check_output(path))
    part = f"{final}.{os.urandom(4).hex()}.part"
    try:
        with open(part, "xb") as file:
            yield file
        os.replace(part, final)
    except BaseException:
        if os.path.exists(part):
            os.unlink(part)
        raise
