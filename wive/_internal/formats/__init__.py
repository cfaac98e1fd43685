"""Readers of mesh files, a module or folder per format; `wive.meshfile` chooses one and checks its results.

A reader is `read(data, name)`: the file's bytes and its name for errors. It returns vertices (v,3) and
triangles (f,3) in the file's own order, nothing merged or dropped. It raises ValueError in one line: the
file, the place in it, what was expected, what was found and how to mend it. Readers of text also take the
dtype of the vertices, so that each number is rounded once. That of glTF takes the folder of its other files.
"""

from typing import Any

from numpy.typing import NDArray

Mesh = tuple[NDArray[Any], NDArray[Any]]
