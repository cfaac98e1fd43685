"""PLY: red, green and blue of vertices, else of faces."""

from __future__ import annotations

import numpy as np

from wive._internal.formats.colours import Colours, linear, linear_guessed, of_triangles
from wive._internal.formats.ply import LISTS
from wive._internal.formats.ply_binary import BinaryRows, BinaryTable
from wive._internal.formats.ply_header import Element, Property, read_header
from wive._internal.formats.ply_text import TextRows, TextTable
from wive._internal.formats.text import unmarked

NAMES = ("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b")


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(v,3) or (f,1,3); integers are sRGB from 0 to their type's largest number."""
    data = unmarked(data, name)
    header = read_header(data, name)
    if not any(_channels(element) for element in header.elements):
        return None
    rows = BinaryRows(data, name, header) if header.order else TextRows(data, name, header)
    of_faces, whole = [], True
    for element in header.elements:
        table, channels = rows.read(element), _channels(element)
        if element.name == "vertex" and channels:
            return _colours(table, channels)
        if element.name == "face" and element.rows:
            sizes, _ = table.lists(next(each for each in element.properties if each.name in LISTS))
            found = _colours(table, channels) if channels else np.full((element.rows, 3), np.nan)
            of_faces.append(of_triangles(found, sizes))
        whole &= element.name != "tristrips" or not element.rows  # whose triangles have no colours
    return np.concatenate(of_faces) if of_faces and whole else None


def _channels(element: Element) -> list[Property]:
    """The properties that are an element's colour."""
    if element.name not in ("vertex", "face"):
        return []
    properties = {each.name: each for each in element.properties if each.count_type is None}
    names = next((names for names in NAMES if all(name in properties for name in names)), ())
    return [properties[name] for name in names]


def _colours(table: BinaryTable | TextTable, channels: list[Property]) -> Colours:
    values = table.numbers(channels, np.dtype(np.float64)).astype(np.float64)
    kind = np.dtype(channels[0].type)
    return linear_guessed(values) if kind.kind == "f" else linear(values, float(np.iinfo(kind).max))
