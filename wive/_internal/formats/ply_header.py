"""The header of a PLY file: elements, each a table of rows with numbers and lists."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from wive._internal.formats.text import quoted

TYPES = dict(char="i1", uchar="u1", short="i2", ushort="u2", int="i4", uint="u4", float="f4", double="f8")
TYPES |= dict(
    int8="i1", uint8="u1", int16="i2", uint16="u2", int32="i4", uint32="u4", float32="f4", float64="f8"
)
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
LINE_END = re.compile(rb"\r\n|\r|\n")


class Property(NamedTuple):
    """A number per row or, if it has a type of counts, a list of numbers."""

    name: str
    type: str
    count_type: str | None = None


class Element(NamedTuple):
    """A table with so many rows."""

    name: str
    rows: int
    properties: list[Property]

    @property
    def row_bytes(self) -> int:
        """Bytes per row if its lists are empty: no row has fewer."""
        return sum(np.dtype(each.count_type or each.type).itemsize for each in self.properties)


class Header(NamedTuple):
    """What the header says, and where it ends."""

    order: str  # "<" or ">", "" for text
    elements: list[Element]
    end: int  # the first byte after it
    lines: int


def read_header(data: bytes, name: str) -> Header:
    """Read the header; ValueError at its first line that is wrong."""
    ends = _line_ends(data)
    order: str | None = None
    elements: list[Element] = []
    names: set[str] = set()
    property_names: set[str] = set()
    at, number = 0, 0
    while True:
        number += 1
        line_end = ends(at)
        if line_end is None:
            raise _error(name, number, "`end_header`", "the file's end: it is cut short or not PLY")
        raw, at = data[at : line_end[0]], line_end[1]
        words = raw.decode("ascii", "backslashreplace").split()
        if number == 1:
            if words != ["ply"]:
                raise _error(name, number, "`ply`", f"{quoted(raw)}: not a PLY file")
            continue
        match words:
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _ if not all(map(str.isprintable, words)):
                raise _error(name, number, "text", f"{quoted(raw)}: the file is damaged")
            case ["format", form, "1.0"] if order is None and form in FORMATS:
                order = FORMATS[form]
            case ["element", element, count] if re.fullmatch(r"\d{1,18}", count):
                if element in names:
                    raise _error(name, number, "one element of a name", f"a second {element!r:.40}")
                elements.append(Element(element, int(count), []))
                names.add(element)
                property_names = set()
            case ["property", *given] if elements and (found := _property(given)):
                if found.name in property_names:
                    raise _error(name, number, "one property of a name", f"a second {found.name!r:.40}")
                elements[-1].properties.append(found)
                property_names.add(found.name)
            case ["end_header"]:
                break
            case _:
                raise _error(name, number, "a line of a PLY header", f"{quoted(raw)}: the file is damaged")
    if order is None:
        raise _error(name, number, f"a line `format` of {', '.join(FORMATS)} 1.0 before", "`end_header`")
    return Header(order, elements, at, number)


def _property(given: list[str]) -> Property | None:
    match given:
        case ["list", count, item, name] if count in TYPES and item in TYPES and TYPES[count][0] != "f":
            return Property(name, TYPES[item], TYPES[count])
        case [item, name] if item in TYPES:
            return Property(name, TYPES[item])
    return None


def _line_ends(data: bytes) -> Callable[[int], tuple[int, int] | None]:
    """A function from where a line begins to where it ends and the next begins; all end as the first."""
    first = LINE_END.search(data, 0, 1000)
    end = first[0] if first else b"\n"

    def find(at: int) -> tuple[int, int] | None:
        found = data.find(end, at)
        return None if found < 0 else (found, found + len(end))

    return find


def _error(name: str, number: int, expected: str, found: str) -> ValueError:
    return ValueError(f"{name}: line {number}: expected {expected}, got {found}")
