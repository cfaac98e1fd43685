"""Arrays of other libraries as NumPy's, with errors that name the argument."""

from typing import Any

from wive._internal.arrays import NUMPY, Library, WarpArrays, library_of
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


def host_arrays(method: str, **values: Any) -> tuple[list[Any], Library]:
    """The values, by the names of their arguments, as NumPy reads them, and the library of the answer.

    That is the first one other than NumPy; of Warp's arrays, one that holds vectors. Raises ValueError if one
    is not in host memory, where the core computes `method`.
    """
    libraries = {name: library_of(value) for name, value in values.items()}
    for name, library in libraries.items():
        place = place_of(name, library, values[name]) or "a CUDA device"
        if place != "cpu":
            raise ValueError(
                f"{name} must be in host memory, where {method} computes, got an array on {place}: "
                "copy it to the host"
            )
    foreign = [library for library in libraries.values() if library is not NUMPY]
    vectors = [library for library in foreign if isinstance(library, WarpArrays) and library.vectors]
    arrays = [to_numpy(name, libraries[name], value) for name, value in values.items()]
    return arrays, (vectors or foreign or [NUMPY])[0]


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
