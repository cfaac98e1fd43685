"""Which format a file has: by its name, or by its first bytes."""

from __future__ import annotations

import codecs
import io
import os
import re
import zipfile

from wive._internal.formats.text import COMMENT, MARKS
from wive._internal.scalars import shown

OBJ_LINE = re.compile(rb"^[ \t]*(?:v|f)[ \t]+[-+.\d]", re.MULTILINE)
OFF_WORD = re.compile(rb"(?:ST)?C?N?4?n?OFF\b|OFF\d")
SNIFFED = 1 << 16
# Extensions of compressed files, and how such files begin.
COMPRESSED = {
    "gz": b"\x1f\x8b\x08",
    "bz2": b"BZh",
    "xz": b"\xfd7zXZ\0",
    "zst": b"\x28\xb5\x2f\xfd",
}


def kind_of(data: bytes, name: str, file_type: str | None) -> str:
    """The extension, without its dot, that stands for the format; ValueError if nothing tells it."""
    if file_type is not None:
        if not isinstance(file_type, str) or not file_type.strip(". "):
            raise ValueError(f"file_type must be a format such as 'ply', got {shown(file_type)}")
        return file_type.strip().lower().rpartition(".")[2]
    stem, suffix = os.path.splitext(name)
    kind = suffix.lower().lstrip(".")
    if kind in COMPRESSED and not compression_of(data):  # of a stream that unpacks, as gzip.open makes
        kind = os.path.splitext(stem)[1].lower().lstrip(".")
    kind = kind or compression_of(data) or _by_content(data)
    if not kind and data:
        raise ValueError(f"{name}: nothing tells its format: pass file_type, such as 'ply'")
    return kind


def compression_of(data: bytes) -> str:
    """The extension of a compressed file that begins so, "" if it is none."""
    return next((kind for kind, head in COMPRESSED.items() if data.startswith(head)), "")


def _by_content(data: bytes) -> str:
    """The format that the first bytes show, "" if none."""
    head = data[:SNIFFED]
    encoding = next((encoding for mark, encoding in MARKS if head.startswith(mark)), None)
    if encoding:
        head = head.decode(encoding, "ignore").encode()
    head = head.removeprefix(codecs.BOM_UTF8).lstrip()
    if re.match(rb"ply\s", head):
        return "ply"
    if head.startswith(b"glTF"):
        return "glb"
    if head.startswith(b"PK"):
        return _by_members(data)
    if head.startswith(b"{") and b'"asset"' in data:
        return "gltf"
    if b"<COLLADA" in head:
        return "dae"
    if OFF_WORD.match(COMMENT.sub(b"", head).lstrip()):
        return "off"
    if is_binary_stl(data) or head[:5].lower() == b"solid":
        return "stl"
    return "obj" if OBJ_LINE.search(head) else ""


def _by_members(data: bytes) -> str:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return "npz"
    if any(name.lower().endswith(".model") for name in names):
        return "3mf"
    return "npz" if not names or any(name.endswith(".npy") for name in names) else "zip"


def is_binary_stl(data: bytes) -> bool:
    """Whether the length is that of a binary STL file with the number of facets in its header."""
    return len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")
