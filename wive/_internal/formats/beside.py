"""Files that a mesh file names: they lie in its folder or below, and are ordinary files."""

from __future__ import annotations

import os


def is_below(name: str) -> bool:
    """Whether a path with slashes stays in its folder."""
    parts = name.split("/")
    return not (not parts[0] or ":" in name or "\0" in name or ".." in parts)


def beside(folder: str, name: str) -> str | None:
    """The path of an ordinary file that is named so in a folder or below; None if there is none."""
    name = name.replace("\\", "/")
    path = os.path.join(folder, *name.split("/"))
    return path if is_below(name) and os.path.isfile(path) else None
