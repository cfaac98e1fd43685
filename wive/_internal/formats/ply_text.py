"""Rows of a PLY file of text: one per line."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.ply_header import Element, Header, Property
from wive._internal.formats.text import Ints, Text, plain


class TextTable:
    """An element's rows: where in the text the words of each property are."""

    def __init__(self, text: Text, heads: Ints, counts: Ints, element: Element) -> None:
        """Walk along all rows together; ValueError at the line of the first row that is wrong."""
        self._text = text
        self._first: dict[str, Ints] = {}
        self._sizes: dict[str, Ints] = {}
        at, ends = heads.copy(), heads + counts
        for each in element.properties:
            text.check(
                at < ends,
                heads,
                f"expected more numbers, up to `{each.name:.40}` of element `{element.name:.40}`",
            )
            if each.count_type:
                sizes = text.integers(at)
                text.check(
                    (sizes >= 0) & (sizes < ends - at), heads, f"expected all of the list `{each.name:.40}`"
                )
                self._sizes[each.name] = sizes
                at = at + 1
            self._first[each.name] = at
            at = at + (sizes if each.count_type else 1)
        text.check(at == ends, heads, f"expected no more numbers than element `{element.name:.40}` has")

    def numbers(self, properties: list[Property], dtype: np.dtype[Any]) -> NDArray[Any]:
        """A column per property."""
        return self._text.reals(np.stack([self._first[each.name] for each in properties], axis=1), dtype)

    def lists(self, listed: Property) -> tuple[Ints, Ints]:
        """The size of each row's list, and the items of all."""
        sizes = self._sizes[listed.name]
        return sizes, self._text.integers(self._text.ranges(self._first[listed.name], sizes))


class TextRows:
    """Reads elements in the file's order."""

    def __init__(self, data: bytes, name: str, header: Header) -> None:
        """Compare the header's counts with the lines that follow it."""
        self._text = Text(plain(data[header.end :], name, header.lines), name, header.lines)
        self._at = 0
        rows = {each.name: each.rows for each in header.elements if each.properties}
        if sum(rows.values()) != len(self._text.heads):
            listed = ", ".join(f"{count:,} of `{element:.40}`" for element, count in rows.items()) or "none"
            raise ValueError(
                f"{name}: header: expected a line per row, {listed:.200}, "
                f"got {len(self._text.heads):,} lines: the file is cut short or damaged"
            )

    def read(self, element: Element) -> TextTable:
        """The rows of the next element."""
        rows = slice(self._at, self._at + element.rows if element.properties else self._at)
        self._at = rows.stop
        return TextTable(self._text, self._text.heads[rows], self._text.counts[rows], element)

    def finish(self) -> None:
        """Do nothing: the lines were counted at the beginning."""
