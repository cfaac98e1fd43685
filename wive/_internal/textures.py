"""The files beside a mesh that belong to it, which no output may replace: textures, buffers, materials."""

import json
import mmap
import os
import re
from collections.abc import Iterator

from wive._internal.files import PathLike, file_name

MATERIALS = re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]+?)[ \t]*$", re.MULTILINE)

# Bytes per letter of a name, as URIs and JSON write those that take most.
MOST_SPELLING = 12


def refuse_part(mesh: PathLike, output: str) -> None:
    """Raise ValueError if a file would be replaced that a mesh file, or a material file of it, names.

    Folders are never replaced.
    """
    names = {os.path.basename(output), os.path.basename(os.path.realpath(output))}
    if os.path.isfile(output) and any(_names(file, names) for file in _files(file_name(mesh))):
        raise ValueError(
            f"output file {output!r} exists and the mesh {file_name(mesh)!r} names it, "
            "as its texture or another part: choose another name"
        )


def _files(mesh: str) -> Iterator[str]:
    """The mesh file, the material files in its folder, and those that it names elsewhere."""
    yield mesh
    folder = os.path.dirname(mesh) or "."
    found = {os.path.join(folder, name) for name in os.listdir(folder) if name.lower().endswith(".mtl")}
    if mesh.lower().endswith(".obj") and os.path.getsize(mesh):
        with open(mesh, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            named = [os.fsdecode(name[1]).replace("\\", "/") for name in MATERIALS.finditer(content)]
        found |= {os.path.join(folder, name) for name in named}
    yield from (file for file in found if os.path.isfile(file))


def _names(path: str, names: set[str]) -> bool:
    if os.path.getsize(path) == 0:  # can't be mapped
        return False
    # The whole name, maybe behind an encoded slash: "room.png" is not in "bedroom.png".
    spelled = b"|".join(map(_spellings, names))
    whole = re.compile(rb"(?:(?<![\w.-])|(?<=%2f))(?:" + spelled + rb")(?![\w.-])", re.IGNORECASE)
    reach = MOST_SPELLING * max(map(len, names))
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return any(
            whole.search(content, max(0, found.start() - reach), found.end() + 1)
            for ending in {ending for name in names for ending in _endings(name)}
            for found in ending.finditer(content)
        )


def _endings(name: str) -> Iterator[re.Pattern[bytes]]:
    """Patterns of the name's extension that begin with plain letters: these are found many times as fast."""
    stem, _, letters = name.rpartition(".")
    either = b"".join(
        b"[%b%b]" % (letter.lower().encode(), letter.upper().encode())
        if letter.isascii() and letter.isalpha()
        else re.escape(letter.encode(errors="surrogateescape"))
        for letter in letters
    )
    dots = (rb"\.", rb"%2[eE]", rb"\\u002[eE]") if stem else (b"",)
    return (re.compile(dot + either) for dot in dots)


def _spellings(name: str) -> bytes:
    """A pattern of the name as it is, and with characters as URIs (%20) and JSON (\\u0020) may write them."""
    pattern = b""
    for letter in name:
        raw = letter.encode(errors="surrogateescape")
        percent = b"".join(b"%%%02x" % byte for byte in raw)
        units = json.dumps(letter)[1:-1] if not letter.isascii() else f"\\u{ord(letter):04x}"
        pattern += b"(?:" + b"|".join(map(re.escape, (raw, percent, units.encode()))) + b")"
    return pattern
