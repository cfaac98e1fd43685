"""COLLADA geometries: positions, and triangles, polygons, strips and fans in the order of the file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.dae.tree import Document, Element
from wive._internal.formats.triangulate import fan, strip, triangulate

PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


@dataclass(frozen=True)
class Geometry:
    """All positions of a geometry, and its triangles."""

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]


@dataclass(frozen=True)
class Piece:
    """The triangles of a primitive element of a mesh.

    It lists vertices by rows of indices (n,stride), in which one column is the position; `corners` (f,3) are
    the rows of its triangles' corners.
    """

    mesh: Element
    primitive: Element
    positions: NDArray[np.float64]
    rows: NDArray[np.int64]
    column: int
    corners: NDArray[np.int64]


def read_geometry(document: Document, geometry: Element, name: str) -> Geometry:
    """The mesh of a geometry; lines and splines have no triangles. Errors of polygons begin with `name`."""
    found = pieces(document, geometry, name)
    triangles = [one.rows[one.corners, one.column].astype(np.int32) for one in found]
    vertices = found[0].positions if found else np.empty((0, 3))
    return Geometry(vertices, np.concatenate([np.empty((0, 3), np.int32), *triangles]))


def pieces(document: Document, geometry: Element, name: str) -> list[Piece]:
    """The pieces of a geometry in order; those of one mesh share its positions."""
    if geometry.first("spline"):
        return []
    mesh = geometry.first("mesh")
    if mesh is None:
        kinds = ", ".join(child.tag for child in geometry.children) or "nothing"
        raise ValueError(f"{geometry.place}: expected a mesh, found {kinds:.60}: export it as triangles")
    found = [one for one in mesh.all(*PRIMITIVES) if one.children or one.whole("count")]
    if not found:
        return []
    vertices = positions(document, mesh.one("vertices"))
    return [read_piece(mesh, primitive, vertices, name) for primitive in found]


def positions(document: Document, vertices: Element) -> NDArray[np.float64]:
    """The source of a mesh's POSITION, as its accessor picks it from an array."""
    inputs = [one for one in vertices.all("input") if one.attributes.get("semantic") == "POSITION"]
    if len(inputs) != 1:
        raise ValueError(f"{vertices.place}: expected one input POSITION, found {len(inputs)}")
    return picked(document, inputs[0], "XYZ")


def picked(document: Document, one: Element, axes: str, what: str = "positions") -> NDArray[np.float64]:
    """The rows of an input's source, numbers named after these axes; rows of positions have no others."""
    source = document.target(one, "source", "source")
    accessor = source.one("technique_common").one("accessor")
    array = document.target(accessor, "source", "float_array", "int_array")
    values = array.numbers(array.whole("count"))
    names = [one.attributes.get("name", "") for one in accessor.all("param")]
    count, stride = accessor.whole("count"), accessor.whole("stride", 1)
    start = accessor.whole("offset", 0)
    columns = [at for at, axis in enumerate(names) if axis] or list(range(len(names)))
    if what != "positions" and set(axes) <= set(names):
        columns = [names.index(axis) for axis in axes]
    elif what != "positions":
        columns = columns[: len(axes)]
    elif sorted(names[at] for at in columns) == sorted(axes):
        columns = [names.index(axis) for axis in axes]
    if len(columns) != len(axes) or max(columns) >= stride:
        expected = f"{', '.join(axes[:-1])} and {axes[-1]}"
        raise ValueError(
            f"{accessor.place}: expected params {expected} in a stride of {stride}, found {names}"
        )
    if count and start + (count - 1) * stride + max(columns) >= len(values):
        raise ValueError(
            f"{accessor.place}: claims {count} {what} of stride {stride}, {array.place} has {len(values)} "
            "numbers: the file is damaged"
        )
    rows = start + stride * np.arange(count)[:, None]
    result: NDArray[np.float64] = values[rows + np.array(columns)]
    return result


def read_piece(mesh: Element, primitive: Element, vertices: NDArray[np.float64], name: str) -> Piece:
    """The triangles of a primitive element of a mesh with these positions."""
    inputs = list(primitive.all("input"))
    stride = max((one.whole("offset") for one in inputs), default=-1) + 1
    offsets = [one.whole("offset") for one in inputs if one.attributes.get("semantic") == "VERTEX"]
    if len(offsets) != 1:
        raise ValueError(f"{primitive.place}: expected one input VERTEX, found {len(offsets)}")
    if primitive.first("ph"):
        raise ValueError(f"{primitive.place}: has polygons with holes, which are not read: export triangles")
    runs = [np.empty((0, stride), np.int64)]
    for run in primitive.all("p"):
        numbers = run.integers()
        if len(numbers) % stride:
            raise ValueError(f"{run.place}: expected a multiple of {stride} numbers, found {len(numbers)}")
        runs.append(numbers.reshape(-1, stride))
    rows = np.concatenate(runs)
    listed = rows[:, offsets[0]]
    if len(listed) and listed.max() >= len(vertices):
        raise ValueError(
            f"{primitive.place}: has the index {listed.max()}, expected at most {len(vertices) - 1}: "
            "the file is damaged"
        )
    found = taken_apart(primitive, [len(run) for run in runs[1:]], vertices[listed], name)
    claimed = primitive.whole("count")
    made = len(runs) - 1
    if primitive.tag in ("triangles", "polylist"):  # taken_apart has checked the latter
        made = len(found) if primitive.tag == "triangles" else claimed
    if made != claimed:
        raise ValueError(f"{primitive.place}: claims a count of {claimed}, holds {made}: the file is damaged")
    return Piece(mesh, primitive, vertices, rows, offsets[0], found)


def taken_apart(
    primitive: Element, runs: list[int], vertices: NDArray[np.float64], name: str
) -> NDArray[np.int64]:
    """Triangles (f,3) of the vertices (n,3) that a primitive lists, in runs of these lengths."""
    listed = np.arange(len(vertices))
    if primitive.tag == "triangles":
        if len(listed) % 3:
            raise ValueError(f"{primitive.place}: expected a multiple of 3 vertices, found {len(listed)}")
        return listed.reshape(-1, 3)
    if primitive.tag == "polylist":
        runs = primitive.one("vcount").integers().tolist()
        if len(runs) != primitive.whole("count") or sum(runs) != len(listed):
            raise ValueError(
                f"{primitive.place}: claims {primitive.whole('count')} polygons, vcount has {len(runs)} of "
                f"{sum(runs)} vertices, p has {len(listed)}: the file is damaged"
            )
    if min(runs, default=3) < 3:
        raise ValueError(f"{primitive.place}: expected at least 3 vertices each, found {min(runs)}")
    if primitive.tag in ("polylist", "polygons"):
        return triangulate(vertices, np.array(runs, np.int64), listed, name)
    pieces = [np.empty((0, 3), np.int64)]
    for run in np.split(listed, np.cumsum(runs)[:-1]):
        pieces.append(strip(run) if primitive.tag == "tristrips" else fan(run))
    return np.concatenate(pieces)
