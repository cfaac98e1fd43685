"""A scene as one image of bytes: tree, mesh and options, in a file or in shared memory, used where it lies.

    0    8  magic
    8    4  version
    12   4  bytes of the header
    16  16  digest of the first 16 bytes and the header
    32      header: JSON, padded with spaces
    ...     units, vertices, faces, and offsets of meshes if there are several, each from a multiple of 64 on

Numbers are little-endian. The header has the size and the checksum of each part, so the digest stands for all
of them. It is read when an image is opened; the parts are verified before the first query, by the core.
"""

from __future__ import annotations

import hashlib
import json
import struct
import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.arguments import choice
from wive._internal.precision import Floats
from wive._internal.storage import GEOMS, Options, geom_offsets, geoms_of_offsets, refuse_newer
from wive.geoms import Geoms

MAGIC = b"\x93WIVE\r\n\x1a"
VERSION = 2  # version 1 is storage.py's
PREFIX = struct.Struct("<8sII16s")
ALIGNMENT = 64
MOST_HEADER = 1 << 20
DIGEST_BYTES = 16
PARTS = ("units", "vertices", "faces", GEOMS)

Bytes = NDArray[np.uint8]


class Image(NamedTuple):
    """What is written: the prefix with the header, and the arrays of the parts."""

    head: bytes
    parts: list[Bytes]

    @property
    def size(self) -> int:
        """The number of bytes of the whole."""
        return _places(len(self.head), [len(part) for part in self.parts])[-1][1]

    def pieces(self) -> Iterator[bytes | Bytes]:
        """Everything in order."""
        yield self.head
        end = len(self.head)
        for part, (begin, after) in zip(
            self.parts, _places(end, [len(part) for part in self.parts]), strict=True
        ):
            yield bytes(begin - end)
            yield part
            end = after


class Content(NamedTuple):
    """What an image holds, in the image's own memory."""

    digest: str
    units: Bytes
    vertices: Floats
    faces: NDArray[np.int32]
    geoms: Geoms | None
    options: Options
    facts: dict[str, Any]  # for `_cpu.stored_tree`
    checksums: list[int]


def image_of(bvh: _cpu.Bvh, faces: NDArray[np.int32], geoms: Geoms | None, options: Options) -> Image:
    """The image of a scene."""
    import wive

    parts = [_bytes_of(array) for array in (bvh.units, bvh.vertices, faces)]
    saved: dict[str, Any] = {**options}
    header: dict[str, Any] = {
        "wive": wive.__version__,
        "options": saved,
        "precision": bvh.precision,
        "tree": bvh.facts,
        "checksums": [f"{checksum:016x}" for checksum in bvh.checksums()],
    }
    if geoms is not None:
        parts.append(_bytes_of(geom_offsets(geoms)))
        saved[GEOMS] = len(geoms)
        header["checksums"].append(_digest(parts[-1].tobytes()).hex())
    header["bytes"] = [len(part) for part in parts]
    text = json.dumps(header).encode()
    text += b" " * (-(PREFIX.size + len(text)) % ALIGNMENT)
    start = PREFIX.pack(MAGIC, VERSION, len(text), bytes(DIGEST_BYTES))[:-DIGEST_BYTES]
    return Image(start + _digest(start + text) + text, parts)


def is_image(head: bytes) -> bool:
    """Whether these first bytes of a file are those of an image, maybe a damaged one."""
    return head.startswith(MAGIC)


def content_of(data: Any, name: str, is_rounded: bool = False) -> Content:
    """What an image holds; `data` is its memory, maybe with more behind it if that `is_rounded`.

    Raises ValueError that names it if it is damaged, cut short or of a newer version, as far as the header
    and the sizes tell.
    """
    memory = memoryview(data)
    damaged = f"{name}: is damaged"
    if len(memory) < PREFIX.size:
        raise ValueError(f"{damaged} (cut short after {len(memory)} bytes)")
    magic, version, length, digest = PREFIX.unpack(memory[: PREFIX.size])
    if magic != MAGIC:
        raise ValueError(f"{name}: not a scene saved by wive")
    if length > min(MOST_HEADER, len(memory) - PREFIX.size):
        raise ValueError(f"{damaged} (cut short, or wrong length of its header)")
    text = bytes(memory[PREFIX.size : PREFIX.size + length])
    if _digest(bytes(memory[: PREFIX.size - DIGEST_BYTES]) + text) != digest:
        raise ValueError(f"{damaged} (wrong checksum of its header)")
    if sys.byteorder != "little":
        raise ValueError(f"{name}: holds little-endian numbers, which this machine can't use where they lie")
    try:
        header = json.loads(text)
        refuse_newer(f"{name}: scene file", version, header.get("options"), header.get("wive"), VERSION)
    except (AttributeError, RecursionError, json.JSONDecodeError, UnicodeDecodeError):
        refuse_newer(f"{name}: scene file", version, None, None, VERSION)
        raise ValueError(f"{damaged} (no header)") from None
    if version != VERSION:
        raise ValueError(f"{damaged} (version {version})")
    try:
        parts = _parts(memory, PREFIX.size + length, header["bytes"], is_rounded)
        return _content(digest.hex(), parts, header)
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{damaged} ({reason:.120})") from None


def tree_of(content: Content, name: str, source: object) -> _cpu.Bvh:
    """The tree in an image, which is verified before its first use; ValueError that calls it `name`."""
    options, facts = content.options, content.facts
    try:
        return _cpu.stored_tree(
            content.units,
            content.vertices,
            content.faces,
            accuracy=options["accuracy"],
            nodes=options["nodes"],
            quality=options["quality"],
            **facts,
            checksums=content.checksums,
            name=name,
            source=source,
        )
    except (TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{name}: is damaged (its header: {reason:.120})") from None


def _parts(memory: memoryview, head: int, sizes: list[int], is_rounded: bool) -> list[Bytes]:
    """The parts of these sizes; ValueError unless they fill the memory and zeros are between them."""
    if not 3 <= len(sizes) <= len(PARTS) or any(type(size) is not int or size < 0 for size in sizes):
        raise ValueError("wrong sizes of its parts")
    places = _places(head, sizes)
    expected = places[-1][1]
    if expected != len(memory) and not (is_rounded and expected < len(memory)):
        kind = "cut short" if len(memory) < expected else "too long"
        raise ValueError(f"{kind}: {len(memory)} bytes, expected {expected}")
    end = head
    for begin, after in places:
        if any(memory[end:begin]):
            raise ValueError("bytes between its parts")
        end = after
    return [np.frombuffer(memory, np.uint8, after - begin, begin) for begin, after in places]


def _content(digest: str, parts: list[Bytes], header: dict[str, Any]) -> Content:
    given = header["options"]
    options = Options(
        backend=given["backend"],
        device=given["device"],
        accuracy=given["accuracy"],
        nodes=given["nodes"],
        quality=given["quality"],
    )
    choice("accuracy", options["accuracy"], ("fast", "watertight", "exact"))
    choice("nodes", options["nodes"], ("float32", "compressed"))
    choice("quality", options["quality"], ("medium", "high"))
    choice("precision", header["precision"], ("float32", "float64"))
    vertices = parts[1].view(header["precision"]).reshape(-1, 3)
    faces = parts[2].view(np.int32).reshape(-1, 3)
    checksums = header["checksums"]
    if len(checksums) != len(parts) or (len(parts) == len(PARTS)) != (GEOMS in given):
        raise ValueError("wrong number of its parts")
    geoms = None
    if len(parts) == len(PARTS):
        if _digest(parts[3].tobytes()).hex() != checksums[3]:
            raise ValueError("wrong checksum of its meshes")
        geoms = geoms_of_offsets(parts[3].view(np.int32).reshape(2, -1), len(faces), len(vertices))
    facts = header["tree"]
    if not all(type(facts[name]) is int for name in ("node_count", "triangle_count", "depth")):
        raise TypeError("numbers of its tree")
    return Content(
        digest, parts[0], vertices, faces, geoms, options, facts, [int(text, 16) for text in checksums[:3]]
    )


def _places(head: int, sizes: list[int]) -> list[tuple[int, int]]:
    """Where parts of these sizes begin and end."""
    places, end = [], head
    for size in sizes:
        begin = end + -end % ALIGNMENT
        end = begin + size
        places.append((begin, end))
    return places


def _bytes_of(array: NDArray[Any]) -> Bytes:
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8)


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=DIGEST_BYTES).digest()
