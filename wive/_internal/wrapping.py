"""Results in the arrays of the library that the rays came in."""

from __future__ import annotations

import functools
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

from wive._internal.arrays import Library
from wive._internal.known_meshes import mesh_attributes


class Wrapping(NamedTuple):
    """How a backend's arrays become arrays of a library, and on which device they are computed."""

    library: Library
    device: str  # of the backend's arrays, by Warp's names
    wrap: Callable[[Any], Any]

    def __call__(self, compute: Callable[[], Any]) -> Any:
        """The arrays that `compute` returns, wrapped; it allocates and launches on the library's stream."""
        with self.on_stream():
            return self.wrap(compute())

    def on_stream(self) -> AbstractContextManager[Any]:
        """A block whose Warp launches and allocations go to the library's current stream."""
        return self.library.on_stream(self.device)


def keep_wrapped(results: Any, home: Any, wrapping: Wrapping, *names: str) -> None:
    """Give `results` the arrays of `home` of these names, wrapped, and the mesh of `home`."""
    arrays = {name: wrapping.wrap(getattr(home, name)) for name in names}
    vars(results).update(arrays, **mesh_attributes(home), _home=home, _wrapping=wrapping)


def library_name(array: Any) -> str:
    """The package that an array's type comes from."""
    return type(array).__module__.partition(".")[0]


def from_home(member: Any) -> Any:
    """`member`, a property or a method of results, computed by their `_home` and wrapped by `_wrapping`."""
    if isinstance(member, property):
        name = member.fget.__name__  # type: ignore[union-attr]
        return property(lambda self: self._wrapping(lambda: getattr(self._home, name)), doc=member.__doc__)

    @functools.wraps(member)
    def method(self: Any, *arguments: Any, **keywords: Any) -> Any:
        return self._wrapping(lambda: getattr(self._home, member.__name__)(*arguments, **keywords))

    return method
