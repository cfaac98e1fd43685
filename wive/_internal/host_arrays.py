"""Arrays of other libraries as NumPy's, with errors that name the argument."""

from typing import Any

from wive._internal.arrays import Library, library_of
from wive._internal.scalars import unreadable


def host_array(name: str, value: Any) -> Any:
    """`value` as an array that NumPy can read; ValueError if it is not in host memory."""
    library = library_of(value)
    place = place_of(name, library, value) or "a CUDA device"
    if place != "cpu":
        raise ValueError(
            f"{name} must be in host memory, where trees are built, got an array on {place}: "
            "copy it to the host"
        )
    return to_numpy(name, library, value)


def place_of(name: str, library: Library, value: Any) -> str | None:
    """The array's device as its library tells it.

    TypeError if that fails, as for the arrays without numbers that a compiler traces.
    """
    try:
        return library.device(value)
    except Exception as error:  # libraries raise anything
        raise unreadable(name, value, error) from error


def to_numpy(name: str, library: Library, value: Any) -> Any:
    """The array as NumPy's; TypeError if its library can't export it, as for dtypes that NumPy lacks."""
    try:
        return library.to_numpy(value)
    except MemoryError:
        raise
    except Exception as error:  # libraries raise anything
        raise unreadable(name, value, error) from error
