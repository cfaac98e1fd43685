"""What the page of the Python interface needs to know of docstrings: lines behind >>> are programs."""

from __future__ import annotations

import re
from typing import Any

import griffe

LINES = re.compile(r"^(?:>>>|\.\.\.) .*(?:\n(?:>>>|\.\.\.) .*)*", re.MULTILINE)


def with_blocks(text: str) -> str:
    """The text, each run of lines with prompts as a block of code without them."""

    def block(lines: re.Match[str]) -> str:
        return "```python\n" + "\n".join(line[4:] for line in lines[0].splitlines()) + "\n```"

    return LINES.sub(block, text)


class Examples(griffe.Extension):
    """Makes blocks of code of the examples in every docstring."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Called for every module, class, function and attribute."""
        if obj.docstring is not None:
            obj.docstring.value = with_blocks(obj.docstring.value)
