"""NumPy's own files, read without trusting them."""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.files import PathLike


def read_npz(path: PathLike, expected: str) -> dict[str, NDArray[Any]]:
    """Every array of an npz file; `expected` says in errors what the file should have been."""
    loaded = _load(path, expected)
    if isinstance(loaded, np.ndarray):
        raise ValueError(f"{os.fspath(path)}: not {expected}")
    return loaded


def read_npy_or_npz(path: PathLike, expected: str) -> NDArray[Any] | dict[str, NDArray[Any]]:
    """The array of an npy file, or every array of an npz file by name."""
    return _load(path, expected)


def check_input(path: PathLike) -> str:
    """Raise OSError unless `path` is a file that can be read; return it as text."""
    name = os.fspath(path)
    if not os.path.exists(name):
        raise FileNotFoundError(f"{name}: no such file")
    if not os.path.isfile(name):
        raise OSError(f"{name}: not a file")
    if not os.access(name, os.R_OK):
        raise PermissionError(f"{name}: not readable")
    return name


def _load(path: PathLike, expected: str) -> NDArray[Any] | dict[str, NDArray[Any]]:
    name = check_input(path)
    try:
        with open(name, "rb") as file:
            loaded = np.load(file, allow_pickle=False)
            return loaded if isinstance(loaded, np.ndarray) else dict(loaded)
    except MemoryError:
        raise
    except Exception:  # NumPy raises anything on damaged bytes: tokenizer and zip errors among others
        raise ValueError(f"{name}: not {expected}, or damaged") from None
