"""XML as events, without document types: their entities can be made to grow without end."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from xml.parsers import expat

Attributes = dict[str, str]


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
        raise ValueError(
            f"line {error.lineno}: expected XML ({reason}): the file is cut off or damaged"
        ) from None
    except LookupError as error:
        raise ValueError(f"line 1: {error}: save the file as UTF-8") from None
