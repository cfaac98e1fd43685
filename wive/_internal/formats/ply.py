"""PLY, text and binary: vertices, faces and triangle strips; other elements and properties are skipped."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats import Mesh
from wive._internal.formats.ply_binary import BinaryRows
from wive._internal.formats.ply_header import Element, Property, read_header
from wive._internal.formats.ply_text import TextRows
from wive._internal.formats.text import Ints, unmarked
from wive._internal.formats.triangulate import triangulate

AXES = ("x", "y", "z")
LISTS = ("vertex_indices", "vertex_index")
# Ends a strip of a list of strips.
RESTART = -1


def read(data: bytes, name: str, dtype: np.dtype[Any]) -> Mesh:
    """Vertices, of this dtype in text and of the file's else, and triangles."""
    data = unmarked(data, name)
    header = read_header(data, name)
    rows: TextRows | BinaryRows
    rows = BinaryRows(data, name, header) if header.order else TextRows(data, name, header)
    vertices: NDArray[Any] | None = None
    lists: list[tuple[Element, Ints, Ints]] = []
    for element in header.elements:
        table = rows.read(element)
        if element.name == "vertex":
            vertices = table.numbers([_property(element, [axis], name) for axis in AXES], dtype)
        elif element.name in ("face", "tristrips") and element.rows:
            lists.append((element, *table.lists(_property(element, LISTS, name))))
    rows.finish()
    if vertices is None:
        raise ValueError(f"{name}: header: expected an element `vertex`, got none")
    triangles = [
        _strips(vertices, sizes, items, name)
        if element.name == "tristrips"
        else _faces(vertices, sizes, items, name)
        for element, sizes, items in lists
    ]
    return vertices, np.concatenate([np.empty((0, 3), np.int64), *triangles])


def _property(element: Element, names: list[str] | tuple[str, ...], name: str) -> Property:
    """The property of one of these names; ValueError if it isn't of the kind that its name says."""
    is_list = names is LISTS
    for each in element.properties:
        if each.name in names and (each.count_type is not None) == is_list:
            if is_list and each.type[0] == "f":
                break
            return each
    kind = "a list of integers" if is_list else "a number"
    listed = ", ".join(each.name for each in element.properties) or "none"
    raise ValueError(
        f"{name}: header: expected {kind} `{names[0]}` of element `{element.name}`, "
        f"got the properties {listed:.200}"
    )


def _faces(vertices: NDArray[Any], sizes: Ints, items: Ints, name: str) -> Ints:
    small = np.flatnonzero(sizes < 3)
    if small.size:
        raise ValueError(f"{name}: face {small[0]:,}: expected at least three corners, got {sizes[small[0]]}")
    _check_range(items, sizes, len(vertices), f"{name}: face")
    return triangulate(vertices, sizes, items, name)


def _strips(vertices: NDArray[Any], sizes: Ints, items: Ints, name: str) -> Ints:
    """Triangles of strips: every second one is turned over; those without area count as well."""
    _check_range(np.where(items == RESTART, 0, items), sizes, len(vertices), f"{name}: triangle strip")
    if not items.size:
        return np.empty((0, 3), np.int64)
    ends = np.cumsum(sizes)[:-1]
    flat = np.insert(items, ends, RESTART)
    place = np.arange(len(flat))
    begin = np.maximum.accumulate(np.where(flat == RESTART, place + 1, 0))
    first = place[:-2][(flat[:-2] != RESTART) & (flat[1:-1] != RESTART) & (flat[2:] != RESTART)]
    is_odd = (first - begin[first]) % 2
    return np.stack([flat[first + is_odd], flat[first + 1 - is_odd], flat[first + 2]], axis=1)


def _check_range(items: Ints, sizes: Ints, vertex_count: int, what: str) -> None:
    wrong = (items < 0) | (items >= vertex_count)
    if wrong.any():
        at = int(np.argmax(wrong))
        row = int(np.searchsorted(np.cumsum(sizes), at, side="right"))
        raise ValueError(
            f"{what} {row:,}: expected an index from 0 to {vertex_count - 1:,}, the file's vertices, "
            f"got {items[at]:,}"
        )
