"""COLLADA documents as trees of elements, by their local names, with checked access.

https://www.khronos.org/files/collada_spec_1_4.pdf; version 1.5 differs in nothing that is read here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.xml_events import Attributes, Handler, floats, parse


@dataclass
class Element:
    """An element, with the line that it begins on."""

    tag: str
    line: int
    attributes: Attributes
    children: list[Element] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)

    @property
    def place(self) -> str:
        """Where errors say it is."""
        key = self.attributes.get("id")
        return f"line {self.line}: {self.tag}" + ("" if key is None else f" {key!r:.40}")

    def all(self, *tags: str) -> Iterator[Element]:
        """Children with one of these tags, in order."""
        return (child for child in self.children if child.tag in tags)

    def first(self, tag: str) -> Element | None:
        """The first child with this tag."""
        return next(self.all(tag), None)

    def one(self, tag: str) -> Element:
        """The first child with this tag; ValueError if there is none."""
        found = self.first(tag)
        if found is None:
            raise ValueError(f"{self.place}: expected an element {tag!r}: the file is damaged")
        return found

    def attribute(self, key: str) -> str:
        """An attribute; ValueError if there is none."""
        if key not in self.attributes:
            raise ValueError(f"{self.place}: expected an attribute {key!r}: the file is damaged")
        return self.attributes[key]

    def whole(self, key: str, default: int | None = None) -> int:
        """An attribute that is a whole number from 0."""
        if default is not None and key not in self.attributes:
            return default
        text = self.attribute(key).strip()
        if not (text.isascii() and text.isdigit() and len(text) < 19):
            raise ValueError(f"{self.place}: {key}: expected a whole number from 0, found {text!r:.40}")
        return int(text)

    def numbers(self, count: int | None = None) -> NDArray[np.float64]:
        """The finite numbers that are its text, `count` of them unless that is None."""
        try:
            numbers = floats("".join(self.pieces).split())
        except ValueError as error:
            raise ValueError(f"{self.place}: {error}: the file is damaged") from None
        if count is not None and len(numbers) != count:
            raise ValueError(
                f"{self.place}: expected {count} numbers, found {len(numbers)}: the file is damaged"
            )
        return numbers

    def integers(self) -> NDArray[np.int64]:
        """The whole numbers that are its text."""
        numbers = self.numbers()
        wrong = np.flatnonzero(~((numbers >= 0) & (numbers < 2**31) & (numbers % 1 == 0)))
        if len(wrong):
            found = "".join(self.pieces).split()[wrong[0]]
            raise ValueError(
                f"{self.place}: expected whole numbers from 0, found {found!r:.40}: the file is damaged"
            )
        return numbers.astype(np.int64)


class Document(Handler):
    """The root element, and all elements by id."""

    def __init__(self, data: bytes) -> None:
        """Parse the document."""
        self.ids: dict[str, Element] = {}
        top = Element("", 0, {})
        self._open = [top]
        parse([data], self)
        self.root = top.children[0]
        if self.root.tag != "COLLADA":
            raise ValueError(
                f"line {self.root.line}: expected an element 'COLLADA', found {self.root.tag!r:.40}"
            )

    def start(self, tag: str, attributes: Attributes) -> None:
        """Add an element to the tree."""
        element = Element(tag.rpartition(" ")[2], self.line(), attributes)
        self._open[-1].children.append(element)
        self._open.append(element)
        if "id" in attributes:
            self.ids.setdefault(attributes["id"], element)

    def end(self, tag: str) -> None:
        """Close the element."""
        self._open.pop()

    def text(self, text: str) -> None:
        """Add to the text of the element."""
        self._open[-1].pieces.append(text)

    def target(self, element: Element, key: str, *tags: str) -> Element:
        """The element with one of these tags that an attribute such as url="#id" refers to."""
        address = element.attribute(key)
        if not address.startswith("#"):
            raise ValueError(
                f"{element.place}: {key}: {address!r:.60} is in another file, which is not read: export the "
                "scene as one file"
            )
        found = self.find(address)
        if found is None or found.tag not in tags:
            raise ValueError(f"{element.place}: {key}: expected the id of a {tags[0]}, found {address!r:.60}")
        return found

    def find(self, address: str) -> Element | None:
        """The element that "#id" stands for."""
        if not address.startswith("#"):
            return None
        return self.ids.get(address[1:]) or self.ids.get(unquote(address[1:]))
