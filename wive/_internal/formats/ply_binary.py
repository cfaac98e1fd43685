"""Rows of a binary PLY file."""

from __future__ import annotations

from array import array
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.ply_header import Element, Header, Property
from wive._internal.formats.text import Ints


class BinaryTable:
    """An element's rows: the byte at which each property begins in each row, and the sizes of its lists."""

    def __init__(self, data: bytes, order: str, rows: int) -> None:
        """Begin without properties."""
        self._data, self._order, self._rows = data, order, rows
        self.first: dict[str, Ints | tuple[int, int]] = {}  # tuple: of the first row, and from row to row
        self.sizes: dict[str, Ints | int] = {}

    def numbers(self, properties: list[Property], dtype: np.dtype[Any]) -> NDArray[Any]:
        """A column per property."""
        is_single = all(each.type == "f4" for each in properties)
        result = np.empty((self._rows, len(properties)), np.float32 if is_single else np.float64)
        for column, each in enumerate(properties):
            result[:, column] = self._items(each, 1).reshape(-1)
        return result

    def lists(self, listed: Property) -> tuple[Ints, Ints]:
        """The size of each row's list, and the items of all."""
        sizes = self.sizes[listed.name]
        if isinstance(sizes, int):
            return np.full(self._rows, sizes), self._items(listed, sizes).astype(np.int64).reshape(-1)
        return sizes, self._items(listed, sizes).astype(np.int64)

    def _items(self, each: Property, sizes: Ints | int) -> NDArray[Any]:
        dtype = np.dtype(self._order + each.type)
        first = self.first[each.name]
        if isinstance(first, tuple):
            assert isinstance(sizes, int)
            strides = (first[1], dtype.itemsize)
            return np.ndarray((self._rows, sizes), dtype, self._data, first[0], strides)
        after = np.cumsum(sizes) if isinstance(sizes, np.ndarray) else np.arange(1, self._rows + 1)
        total = int(after[-1]) if len(after) else 0
        items = np.repeat(first - (after - sizes) * dtype.itemsize, sizes) + np.arange(total) * dtype.itemsize
        found = np.frombuffer(self._data, np.uint8)[items[:, None] + np.arange(dtype.itemsize)]
        values: NDArray[Any] = found.view(dtype).reshape(-1)
        return values


class BinaryRows:
    """Reads elements in the file's order."""

    def __init__(self, data: bytes, name: str, header: Header) -> None:
        """Begin behind the header."""
        self._data, self._name, self._order, self._at = data, name, header.order, header.end

    def read(self, element: Element) -> BinaryTable:
        """The rows of the next element; ValueError, before anything is allocated, if they can't be there."""
        left = len(self._data) - self._at
        if element.rows * element.row_bytes > left:
            raise self._cut(element, left // element.row_bytes)
        table = BinaryTable(self._data, self._order, element.rows if element.properties else 0)
        if not self._read_even(element, table):
            self._read_uneven(element, table)
        return table

    def finish(self) -> None:
        """ValueError if more follows than padding."""
        rest = self._data[self._at :].strip(b"\0 \t\r\n")
        if rest:
            more = len(self._data) - self._at
            raise ValueError(
                f"{self._name}: byte {self._at:,}: expected the file's end, "
                f"got {more:,} bytes more: the header's counts are too small or the file is "
                "damaged"
            )

    def _read_even(self, element: Element, table: BinaryTable) -> bool:
        """Read rows whose lists are as long as the first row's; False if they are not."""
        if not element.rows:
            return False
        at = self._at
        for each in element.properties:
            size = 1
            if each.count_type:
                count = np.dtype(self._order + each.count_type)
                if at + count.itemsize > len(self._data):
                    return False
                size = int(np.frombuffer(self._data, count, 1, at)[0])
                if size < 0:
                    return False
                at += count.itemsize
                table.sizes[each.name] = size
            table.first[each.name] = (at, 0)
            at += size * np.dtype(each.type).itemsize
        stride = at - self._at
        if self._at + stride * element.rows > len(self._data):
            return False
        for each in element.properties:
            first = table.first[each.name]
            assert isinstance(first, tuple)
            table.first[each.name] = (first[0], stride)
            if each.count_type:
                count = np.dtype(self._order + each.count_type)
                begin = first[0] - count.itemsize
                counts = np.ndarray(element.rows, count, self._data, begin, (stride,))
                if (counts != table.sizes[each.name]).any():
                    return False
        self._at += stride * element.rows
        return True

    def _read_uneven(self, element: Element, table: BinaryTable) -> None:
        """Go from row to row."""
        order: Literal["little", "big"] = "little" if self._order == "<" else "big"
        firsts = [array("q") for _ in element.properties]
        sizes = [array("q") for _ in element.properties]
        steps = []
        for each, first, size in zip(element.properties, firsts, sizes, strict=True):
            counts = each.count_type or ""
            count_bytes = np.dtype(counts).itemsize if counts else 0
            item_bytes = np.dtype(each.type).itemsize
            steps.append((first.append, size.append, item_bytes, count_bytes, counts.startswith("i")))
        data, at, end = self._data, self._at, len(self._data)
        for row in range(element.rows):
            for add_first, add_size, item_bytes, count_bytes, is_signed in steps:
                count = 1
                if count_bytes:
                    count = int.from_bytes(data[at : at + count_bytes], order, signed=is_signed)
                    at += count_bytes
                    if count < 0:
                        raise self._error(element, row, at, f"expected a list of items, got {count}")
                    add_size(count)
                add_first(at)
                at += item_bytes * count
            if at > end:
                raise self._cut(element, row)
        self._at = at
        for each, first, size in zip(element.properties, firsts, sizes, strict=True):
            table.first[each.name] = np.array(first, np.int64)
            table.sizes[each.name] = np.array(size, np.int64)

    def _cut(self, element: Element, row: int) -> ValueError:
        what = f"expected {element.rows:,} rows, as the header has, got the file's end: cut short or damaged"
        return self._error(element, row, len(self._data), what)

    def _error(self, element: Element, row: int, at: int, what: str) -> ValueError:
        return ValueError(f"{self._name}: byte {at:,}, row {row:,} of element `{element.name:.40}`: {what}")
