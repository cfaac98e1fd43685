"""STL, binary and text: three vertices of its own per facet, which share none."""

from __future__ import annotations

import codecs
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats import Mesh
from wive._internal.formats.kinds import is_binary_stl
from wive._internal.formats.text import Ints, Text, plain, quoted

HEADER_BYTES = 84
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
# The words of a facet in text; None is a number.
VERTEX = ("vertex", None, None, None)
FACET_WORDS = ("facet", "normal", None, None, None, "outer", "loop", *VERTEX * 3, "endloop", "endfacet")
CORNER_WORDS = np.array([[8, 9, 10], [12, 13, 14], [16, 17, 18]])
UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
# The word that begins and ends solids, what may stand before it, and a facet that follows on its line.
SOLID = re.compile(rb"solid(?!\S)")
MOST_BEFORE = 16  # bytes of `end` and white space
BEFORE_SOLID = re.compile(rb"(?<!\S)(?:end\s*)?\Z")
FACET_START = re.compile(rb"(?<!\S)facet\s+normal\s+[-+.\dni]\S*\s+[-+.\dni]")


def read(data: bytes, name: str, dtype: np.dtype[Any]) -> Mesh:
    """Vertices, of this dtype in text and float32 else, and triangles."""
    corners = _text(data, name, dtype) if is_text(data) else facets(data, name)["corners"]
    return corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3)


def is_text(data: bytes) -> bool:
    """Whether a file is text: headers of binary files may begin with "solid", but text has no zero bytes."""
    return (data.startswith(UTF_16) or b"\0" not in data) and not is_binary_stl(data)


def facets(data: bytes, name: str) -> NDArray[Any]:
    """The facets of a binary file, of the dtype FACET."""
    if len(data) < HEADER_BYTES:
        raise ValueError(
            f"{name}: byte {len(data)}: expected {HEADER_BYTES} bytes of a header, got the file's end: "
            "the file is cut short or not STL"
        )
    count = int.from_bytes(data[HEADER_BYTES - 4 : HEADER_BYTES], "little")
    whole, rest = divmod(len(data) - HEADER_BYTES, FACET.itemsize)
    if count > whole:
        raise ValueError(
            f"{name}: byte {len(data)}: expected {count:,} facets, as the header has, "
            f"got the file's end after {whole:,}: the file is cut short or damaged"
        )
    # Some programs append their own data; whole facets more mean that the header is wrong.
    after = data[HEADER_BYTES + count * FACET.itemsize :]
    if whole > count and not rest and after.strip(b"\0"):
        raise ValueError(
            f"{name}: byte {HEADER_BYTES - 4}: expected the number of facets, {whole:,} by the file's "
            f"length, got {count:,}: mend the header"
        )
    return np.frombuffer(data, FACET, count, HEADER_BYTES)


def _text(data: bytes, name: str, dtype: np.dtype[Any]) -> NDArray[Any]:
    data = plain(data, name).lower()
    text = Text(_without_names(data), name)
    if not re.match(rb"\s*solid(?!\S)", data):
        raise text.error(0, f"expected `solid`, got {quoted(data[:20])}")
    count, rest = divmod(len(text.starts), len(FACET_WORDS))
    words: Ints = np.arange(count * len(FACET_WORDS)).reshape(count, len(FACET_WORDS))
    for facets in (words, np.arange(words.size, len(text.starts))[None]):
        _check_keywords(text, facets)
    if rest:
        expected = f"`{FACET_WORDS[rest]}`" if FACET_WORDS[rest] else "a number"
        raise text.error(len(text.starts), f"expected {expected}, got the file's end")
    return text.reals(words[:, CORNER_WORDS], dtype)


def _without_names(data: bytes) -> bytes:
    """Take out what begins and ends solids, to the line's end or its first facet: names are any words."""
    kept, done, line_end = [], 0, 0
    while found := SOLID.search(data, done):
        begin = BEFORE_SOLID.search(data, max(done, found.start() - MOST_BEFORE), found.start())
        if begin:
            if line_end <= found.end():
                line_end = data.find(b"\n", found.end())
                line_end = len(data) if line_end < 0 else line_end
            facet = FACET_START.search(data, found.end(), line_end)
            kept.append(data[done : begin.start()])
            done = facet.start() if facet else line_end
        else:
            kept.append(data[done : found.end()])
            done = found.end()
    return b"".join([*kept, data[done:]])


def _check_keywords(text: Text, facets: Ints) -> None:
    """ValueError at the first word of facets (n,k), the last one maybe shorter, that is out of place."""
    wrong = np.zeros(facets.shape, bool)
    for place in range(facets.shape[1]):
        keyword = FACET_WORDS[place]
        if keyword:
            wrong[:, place] = ~text.same(facets[:, place], keyword.encode())
    if wrong.any():
        at = int(np.argmax(wrong))
        expected = f"expected `{FACET_WORDS[at % facets.shape[1]]}`"
        raise text.error(int(facets.flat[at]), f"{expected}, got {text.quoted(int(facets.flat[at]))}")
