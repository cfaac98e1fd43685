"""XML as events, without document types: their entities can be made to grow without end."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from xml.parsers import expat
from xml.parsers.expat import errors

import numpy as np
from numpy.typing import NDArray

Attributes = dict[str, str]
# Expat's error for encodings such as Shift JIS.
MULTI_BYTE = "multi-byte encodings are not supported"
# What Python's float takes beside numbers: 1_0 and digits of other scripts.
STRANGE = re.compile(r"[_\x80-\U0010ffff]")


class Handler:
    """What a reader does at each event. Names are those of namespaces, a space and local names."""

    line: Callable[[], int]  # where the parser is

    def start(self, tag: str, attributes: Attributes) -> None:
        """An element begins."""

    def end(self, tag: str) -> None:
        """An element ends."""

    def text(self, text: str) -> None:
        """Characters inside an element."""

    def namespace(self, prefix: str | None, address: str) -> None:
        """The next element declares a prefix."""


def parse(chunks: Iterable[bytes], handler: Handler) -> None:
    """Call the handler for each event; ValueError, which names the line, if the bytes are no XML."""
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    handler.line = lambda: parser.CurrentLineNumber

    def refuse(*_: object) -> None:
        raise ValueError(
            f"line {handler.line()}: has a document type declaration, which is not read: delete it"
        )

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = handler.start
    parser.EndElementHandler = handler.end
    if type(handler).text is not Handler.text:  # calls cost time
        parser.CharacterDataHandler = handler.text
    parser.StartNamespaceDeclHandler = handler.namespace
    try:
        for chunk in chunks:
            parser.Parse(chunk, False)
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        if reason == errors.XML_ERROR_NO_MEMORY:
            raise MemoryError(reason) from None
        raise ValueError(
            f"line {error.lineno}: expected XML ({reason}): the file is cut off or damaged"
        ) from None
    except (LookupError, UnicodeError) as error:
        raise ValueError(f"line 1: {error}: save the file as UTF-8") from None
    except ValueError as error:
        if str(error) != MULTI_BYTE:
            raise
        raise ValueError(f"line 1: {error}: save the file as UTF-8") from None
    finally:  # a circle of references would keep what the handler holds
        del handler.line


def floats(words: list[str]) -> NDArray[np.float64]:
    """The numbers that words are; ValueError, which quotes the word, if one is none."""
    if STRANGE.search("".join(words)):
        wrong = next(word for word in words if STRANGE.search(word))
        raise ValueError(f"could not convert string to float: {wrong!r:.40}")
    return np.array([float(word) for word in words], np.float64)
