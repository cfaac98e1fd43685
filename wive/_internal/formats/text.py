"""Text files as words on lines, and the numbers that the words are, each rounded once."""

from __future__ import annotations

import codecs
import re
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Ends of lines that a continuation joined: white space that still counts as a line.
JOINED = b"\x0b"
# UTF-32 first: its mark begins with UTF-16's.
MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)", re.IGNORECASE)
INTEGER = re.compile(rb"[-+]?\d+")
# But 1.#INF and 1.#QNAN are how some programs print what is no number.
COMMENT = re.compile(rb"(?:(?<!\d\.)#|#(?!INF|IND|[QS]NAN))[^\n]*")
# Words converted at once: their bytes stay in the cache.
BATCH = 1 << 17


def unmarked(data: bytes, name: str) -> bytes:
    """The file without its byte order mark, in one byte per ASCII character."""
    for mark, encoding in MARKS:
        if data.startswith(mark):
            try:
                data = data.decode(encoding).encode()
            except UnicodeError:
                raise ValueError(f"{name}: begins as {encoding.upper()} text, and is not: damaged") from None
    return data.removeprefix(codecs.BOM_UTF8)


def quoted(raw: bytes) -> str:
    """A piece of a file, as errors quote it."""
    found = raw.decode("latin-1").strip()
    return ascii(found if len(found) <= 40 else found[:37] + "...")


def plain(data: bytes, name: str, lines_before: int = 0) -> bytes:
    """The file without its byte order mark, with lines that end in \\n; ValueError if it isn't text."""
    data = unmarked(data, name)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if JOINED in data:
        data = data.replace(JOINED, b" ")
    if b"\0" in data:
        line = data.count(b"\n", 0, data.index(b"\0")) + 1 + lines_before
        raise ValueError(
            f"{name}: line {line}: expected text, got a zero byte: "
            "the file is damaged, binary, or must be saved as UTF-8"
        )
    return data


class Text:
    """A file's words, numbered from 0, and which of them begin its lines."""

    def __init__(self, data: bytes, name: str, lines_before: int = 0) -> None:
        """Find the words of plain text; `lines_before` stand before it in the file called `name`."""
        self.name = name
        self.data = data + b"\n"
        self._lines_before = lines_before
        self._bytes = np.frombuffer(self.data, np.uint8)
        inside = np.zeros(len(self.data) + 1, bool)
        np.greater(self._bytes, 32, out=inside[1:])
        edges = np.flatnonzero(inside[1:] != inside[:-1])
        self.starts, self.ends = edges[0::2], edges[1::2]
        line_ends = np.flatnonzero(self._bytes == ord("\n"))
        begins = np.concatenate([[0], np.searchsorted(self.starts, line_ends)])
        # Words that begin a line, of lines that have any; and one past the last word.
        self.heads: Ints = begins[:-1][np.diff(begins) > 0]
        self.counts: Ints = np.diff(np.append(self.heads, len(self.starts)))

    def quoted(self, word: int) -> str:
        """One word, or the line that it begins, as errors quote it."""
        start, end = self.starts[word], self.ends[word]
        if self.heads[np.searchsorted(self.heads, word, side="right") - 1] == word:
            end = self.data.index(b"\n", start)
        return quoted(self.data[start:end])

    def error(self, word: int, what: str) -> ValueError:
        """An error at the line of this word; that of the last line for one past the last."""
        at = int(self.starts[word]) if word < len(self.starts) else len(self.data.rstrip())
        line = self.data.count(b"\n", 0, at) + self.data.count(JOINED, 0, at) + 1 + self._lines_before
        return ValueError(f"{self.name}: line {line}: {what}")

    def same(self, words: Ints, keyword: bytes) -> Bools:
        """Which of these words are the keyword."""
        starts = self.starts[words]
        result: Bools = self.ends[words] - starts == len(keyword)
        for place, byte in enumerate(keyword):
            # No word of another length is read past the end: it is not the keyword already.
            result[result] = self._bytes[starts[result] + place] == byte
        return result

    def check(self, is_right: Bools, words: Ints, expected: str) -> None:
        """ValueError at the line of the first of the words that is not right."""
        if not is_right.all():
            word = int(words[np.argmin(is_right)])
            raise self.error(word, f"{expected}, got {self.quoted(word)}")

    @staticmethod
    def ranges(first: Ints, counts: Ints) -> Ints:
        """The words of ranges, one behind the other."""
        after = np.cumsum(counts)
        return np.repeat(first - (after - counts), counts) + np.arange(after[-1] if len(after) else 0)

    def places(self, byte: bytes) -> Ints:
        """Where this byte stands in the file."""
        return np.flatnonzero(self._bytes == ord(byte))

    def made_of(self, starts: Ints, ends: Ints, allowed: Bools) -> Bools:
        """Which of the pieces of text, none of them empty, hold allowed bytes only."""
        result = np.empty(len(starts), bool)
        for first in range(0, len(starts), BATCH):
            batch = slice(first, first + BATCH)
            listed, after = self._listed(starts[batch], ends[batch])
            before = np.concatenate([[0], after[:-1]])
            result[batch] = np.logical_and.reduceat(allowed[listed], before)
        return result

    def integers(self, words: Ints, ends: Ints | None = None, starts: Ints | None = None) -> Ints:
        """The words, or pieces of them from `starts` to `ends`, as integers; beyond int64 its limits."""
        starts = self.starts[words] if starts is None else starts
        return self._numbers(words, starts, self.ends[words] if ends is None else ends, np.dtype(np.int64))

    def reals(self, words: Ints, dtype: np.dtype[Any]) -> NDArray[Any]:
        """The words as float32 or float64, whichever is nearest to the decimal number."""
        flat = words.reshape(-1)
        values = self._numbers(flat, self.starts[flat], self.ends[flat], np.dtype(np.float64))
        if dtype == np.float32:
            values = self._rounded(values, flat)
        return values.reshape(words.shape)

    def _numbers(self, words: Ints, starts: Ints, ends: Ints, dtype: np.dtype[Any]) -> NDArray[Any]:
        values = np.empty(len(words), dtype)
        for first in range(0, len(words), BATCH):
            batch = slice(first, first + BATCH)
            listed, after = self._listed(starts[batch], ends[batch] + 1)
            listed[after - 1] = ord(" ")
            try:
                found = np.fromstring(listed.tobytes(), dtype, sep=" ")
            except (ValueError, DeprecationWarning):  # some word is no number; NumPy before 2.4 stops there
                found = values[:0]
            if len(found) != len(after):
                raise self._no_number(words[batch], starts[batch], ends[batch], dtype)
            values[batch] = found
        return values

    def _listed(self, starts: Ints, ends: Ints) -> tuple[NDArray[np.uint8], Ints]:
        """The pieces of text, one behind the other, and where each ends."""
        sizes = ends - starts
        after = np.cumsum(sizes)
        return self._bytes[np.repeat(starts - (after - sizes), sizes) + np.arange(after[-1])], after

    def _no_number(self, words: Ints, starts: Ints, ends: Ints, dtype: np.dtype[Any]) -> ValueError:
        what, pattern = ("an integer", INTEGER) if dtype.kind == "i" else ("a number", NUMBER)
        for word, start, end in zip(words.tolist(), starts.tolist(), ends.tolist(), strict=True):
            found = self.data[start:end]
            if not pattern.fullmatch(found):
                is_comma = pattern is NUMBER and pattern.fullmatch(found.replace(b",", b".", 1))
                mend = ": write decimal points, not commas" if is_comma else ""
                got = quoted(self.data[self.starts[word] : self.ends[word]])
                return self.error(word, f"expected {what}, got {got}{mend}")
        raise AssertionError("NumPy refused a list of numbers")

    def _rounded(self, values: NDArray[np.float64], words: Ints) -> NDArray[np.float32]:
        """float64 values as float32; those half-way between two by what their words say."""
        with np.errstate(over="ignore"):
            result = values.astype(np.float32)
        # Half-way values end in 28 zero bits.
        maybe = np.flatnonzero((values.view(np.uint64) & np.uint64((1 << 28) - 1) == 0) & (values != result))
        for place in maybe[np.isfinite(values[maybe])].tolist():
            word = int(words[place])
            exact = Decimal(self.data[self.starts[word] : self.ends[word]].decode())
            value = float(values[place])
            if exact != value:
                towards = np.inf if exact > value else -np.inf
                with np.errstate(over="ignore"):
                    result[place] = np.float32(np.nextafter(value, towards))
        return result
