"""Saved scenes whose bytes are changed, with digests and checksums that fit again."""

import hashlib
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from wive import _cpu
from wive._internal.tree_file import ALIGNMENT, PREFIX

HEAD = PREFIX.size - 16


def header_of(data: bytes) -> dict[str, Any]:
    """The header of an image."""
    (length,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[PREFIX.size : PREFIX.size + length])


def part_places(data: bytes) -> list[slice]:
    """Where units, vertices and faces are."""
    (length,) = struct.unpack_from("<I", data, 12)
    end, places = PREFIX.size + length, []
    for size in header_of(data)["bytes"]:
        begin = end + -end % ALIGNMENT
        end = begin + size
        places.append(slice(begin, end))
    return places


def with_header(data: bytes, change: Callable[[dict[str, Any]], object], version: int | None = None) -> bytes:
    """The image with a changed header, padded to the old length, and the digest that fits it."""
    header = header_of(data)
    change(header)
    (length,) = struct.unpack_from("<I", data, 12)
    text = json.dumps(header).encode()
    begin = length + PREFIX.size
    if len(text) > length:  # the first part moves by whole steps
        length += (len(text) - length) + -(len(text) - length) % ALIGNMENT
    head = data[:8] + struct.pack("<II", version or struct.unpack_from("<I", data, 8)[0], length)
    text = text.ljust(length)
    return head + hashlib.blake2b(head + text, digest_size=16).digest() + text + data[begin:]


def repaired(data: bytes) -> bytes:
    """The image with checksums that fit its parts."""
    arrays = [np.frombuffer(data[place], np.uint8) for place in part_places(data)[:3]]
    places = part_places(data)
    if any(place.stop > len(data) for place in places):
        return data
    checksums = [f"{checksum:016x}" for checksum in checksums_of(data, arrays)]

    def change(header: dict[str, Any]) -> None:
        header["checksums"][:3] = checksums

    return with_header(data, change)


def checksums_of(data: bytes, arrays: list[Any]) -> tuple[int, int, int]:
    """The core's checksums of these parts of an image."""
    header = header_of(data)
    units = np.zeros(len(arrays[0]) + 64, np.uint8)
    at = -units.ctypes.data % 64
    units = units[at : at + len(arrays[0])]
    units[:] = arrays[0]
    options = {name: header["options"][name] for name in ("accuracy", "nodes", "quality")}
    tree = _cpu.stored_tree(
        units,
        arrays[1].view(header["precision"]).reshape(-1, 3),
        arrays[2].view(np.int32).reshape(-1, 3),
        **options,
        **header["tree"],
        checksums=[0, 0, 0],
        name="",
        source=None,
    )
    return tree.checksums()
