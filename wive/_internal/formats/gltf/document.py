"""glTF documents: the JSON and the buffers of a .gltf or .glb file.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, sections 3.6.1 (buffers) and 4 (GLB).
"""

from __future__ import annotations

import base64
import json
import os
import re
import struct
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

from numpy.typing import NDArray

from wive._internal.formats.beside import beside, is_below
from wive._internal.formats.gltf.fields import Fields, listed, members, short, whole

JSON_CHUNK, BIN_CHUNK = 0x4E4F534A, 0x004E4942
# Buffer views that only a decoder can read, unless their buffer has the data in plain form as well.
COMPRESSION = ("EXT_meshopt_compression", "KHR_meshopt_compression")
# Required extensions that are read, and others that leave triangles where they are.
READ = {
    "EXT_mesh_gpu_instancing",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
}
HARMLESS = re.compile(
    r"[A-Z0-9]+_(materials|lights|texture|audio|physics|xmp|feature|structural|articulations)(_.*)?|"
    r"EXT_(instance_features|mesh_features|mesh_manifold)|KHR_(animation_pointer|implicit_shapes|interactivity)|"
    r"KHR_(node_hoverability|node_selectability|techniques_webgl)|MSFT_(lod|packing_.*)|MOZ_lightmap|"
    r"CESIUM_primitive_outline|AGI_stk_metadata|FB_geometry_metadata|VRM|VRMC_.*"
)


class Document:
    """The JSON of a glTF file, with its buffers, which are read when they are first used.

    `folder` is where external buffers lie; None if there is none, as for a file in memory.
    """

    def __init__(self, data: bytes, folder: str | None) -> None:
        """Read the JSON; raises ValueError unless it is of glTF 2.0 and requires nothing that is not read."""
        self.size = len(data)
        text, self._binary = split_chunks(data)
        self.root = parse(text)
        self.arrays: dict[int, NDArray[Any]] = {}  # of accessors whose data had to be unpacked
        self._folder = folder
        self._buffers: dict[int, memoryview] = {}
        check_version(self.root)
        check_extensions(self.root)

    def item(self, kind: str, index: int, place: str) -> Fields:
        """Object `index` of the array `kind` at the root; `place` is what refers to it."""
        found = listed(self.root, kind, "document")
        if index >= len(found):
            raise ValueError(f"{place}: refers to {kind}[{index}], expected an index below {len(found)}")
        item: Fields = found[index]
        if not isinstance(item, dict):
            raise ValueError(f"{kind}[{index}]: expected an object, found {short(item)}")
        return item

    def view(self, index: int, place: str) -> tuple[memoryview, int]:
        """Bytes and stride (0: packed) of buffer view `index`."""
        here = f"bufferViews[{index}]"
        view = self.item("bufferViews", index, place)
        buffer = whole(view, "buffer", here)
        start, size = whole(view, "byteOffset", here, 0), whole(view, "byteLength", here)
        packed = [name for name in COMPRESSION if name in members(view, "extensions", here)]
        if packed and not self._has_data(buffer, here):
            raise ValueError(
                f"{here}: is compressed by {packed[0]}, which is not read: export the model without mesh "
                "compression, or convert it to PLY"
            )
        data = self._buffer(buffer, here)
        if start + size > len(data):
            raise ValueError(
                f"{here}: ends at byte {start + size}, expected at most {len(data)}, the byteLength of "
                f"buffers[{buffer}]: the file is damaged"
            )
        return data[start : start + size], whole(view, "byteStride", here, 0)

    def image(self, index: int, place: str) -> str | int:
        """The URI of image `index`, or its buffer view."""
        here = f"images[{index}]"
        image = self.item("images", index, place)
        uri = image.get("uri")
        if uri is None:
            return whole(image, "bufferView", here)
        if not isinstance(uri, str):
            raise ValueError(f"{here}: uri: expected text, found {short(uri)}")
        return uri

    def picture(self, source: str | int, place: str) -> bytes | str | None:
        """The bytes or the path of an image; None if it is in a file that is missing or elsewhere."""
        if isinstance(source, int):
            return bytes(self.view(source, place)[0])
        if source[:5].lower() == "data:":
            return decode_data_uri(source, place)
        return None if self._folder is None else beside(self._folder, unquote(source))

    def _has_data(self, index: int, place: str) -> bool:
        buffer = self.item("buffers", index, place)
        return "uri" in buffer or (index == 0 and self._binary is not None)

    def _buffer(self, index: int, place: str) -> memoryview:
        if index not in self._buffers:
            buffer, here = self.item("buffers", index, place), f"buffers[{index}]"
            size = whole(buffer, "byteLength", here)
            if "uri" in buffer:
                data = self._fetch(buffer["uri"], size, here)
            elif index == 0 and self._binary is not None:
                data = self._binary
            else:
                raise ValueError(
                    f"{here}: has no uri and the file has no BIN chunk for it: the file is damaged"
                )
            if len(data) < size:
                raise ValueError(
                    f"{here}: holds {len(data)} bytes, expected its byteLength, {size}: it is damaged"
                )
            self._buffers[index] = data[:size]
        return self._buffers[index]

    def _fetch(self, uri: object, size: int, place: str) -> memoryview:
        if not isinstance(uri, str):
            raise ValueError(f"{place}: uri: expected text, found {short(uri)}")
        if uri[:5].lower() == "data:":
            return memoryview(decode_data_uri(uri, place))
        path = unquote(uri).replace("\\", "/")
        if not is_below(path):
            raise ValueError(
                f"{place}: uri {short(uri)} leads out of the file's folder: put the buffer beside the file "
                "and write its name alone, or save the model as .glb"
            )
        if self._folder is None:
            raise ValueError(
                f"{place}: is in another file, {short(uri)}, which bytes and file objects can't refer to: "
                "pass the path of the .gltf file, or save the model as .glb"
            )
        found = beside(self._folder, path)
        if found is None:
            raise ValueError(
                f"{place}: is in {short(uri)}, which is missing or no ordinary file: put it beside this file"
            )
        with open(found, "rb") as file:
            held = os.fstat(file.fileno()).st_size  # before a huge claim of bytes is allocated
            return memoryview(file.read(min(size, held)))


def split_chunks(data: bytes) -> tuple[bytes, memoryview | None]:
    """The JSON text and, if there is one, the binary chunk of a .glb file; a .gltf file is JSON alone."""
    if data[:4] != b"glTF":
        return data, None
    if len(data) < 12:
        raise ValueError("header: expected 12 bytes: the file is cut off")
    version, size = struct.unpack_from("<2I", data, 4)
    if version != 2:
        raise ValueError(f"header: glTF version {version}, expected 2: convert the file to glTF 2.0")
    if size > len(data):
        raise ValueError(f"header: the file should have {size} bytes and has {len(data)}: it is cut off")
    at, text, binary = 12, None, None
    while at < size:
        if at + 8 > size:
            raise ValueError(
                f"byte {at}: expected the 8 bytes of a chunk's header, found {size - at}: the file is damaged"
            )
        length, kind = struct.unpack_from("<2I", data, at)
        end = at + 8 + length
        if end > size:
            raise ValueError(
                f"byte {at}: a chunk ends at byte {end}, after the file's {size}: the file is damaged"
            )
        if text is None:
            if kind != JSON_CHUNK:
                raise ValueError(f"byte {at}: expected the JSON chunk first, found a chunk of type {kind:#x}")
            text = data[at + 8 : end].rstrip(b"\0")  # some writers pad it so
        elif kind == BIN_CHUNK and binary is None:
            binary = memoryview(data)[at + 8 : end]
        at = end  # chunks of other types are for other readers, by section 4.4
    if text is None:
        raise ValueError("header: the file has no JSON chunk: it is cut off or damaged")
    return text, binary


def parse(text: bytes) -> Fields:
    """The JSON object that `text` is."""

    def refuse(constant: str) -> Any:
        raise ValueError(f"{constant} is no number of JSON")

    try:
        root = json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        reason = (
            "it is nested too deep" if isinstance(error, RecursionError) else " ".join(str(error).split())
        )
        raise ValueError(
            f"JSON: expected a glTF document, found text that is no JSON ({reason:.80})"
        ) from None
    if not isinstance(root, dict):
        raise ValueError(f"JSON: expected a glTF document, an object, found {short(root)}")
    return root


def check_version(root: Fields) -> None:
    """Raise ValueError unless a reader of glTF 2.0 may read the document (section 3.2)."""
    asset = members(root, "asset", "document")
    version, least = asset.get("version"), asset.get("minVersion", "2.0")
    if not isinstance(version, str) or not version.startswith("2.") or least != "2.0":
        found = version if least == "2.0" else f"minVersion {least}"
        raise ValueError(
            f"asset: version: expected '2.0', found {short(found)}: convert the file to glTF 2.0"
        )


def check_extensions(root: Fields) -> None:
    """Raise ValueError if the document requires an extension that might change triangles."""
    for name in listed(root, "extensionsRequired", "document"):
        if not isinstance(name, str) or (
            name not in READ and name not in COMPRESSION and not HARMLESS.fullmatch(name)
        ):
            raise ValueError(
                f"extensionsRequired: {short(name)} is not read: export the model without this extension, or "
                "convert it to PLY"
            )


def decode_data_uri(uri: str, place: str) -> bytes:
    """The bytes of a data: URI, in base64 or percent-encoded (RFC 2397)."""
    head, comma, body = uri.partition(",")
    if not comma:
        raise ValueError(f"{place}: uri: expected data:[type][;base64],DATA, found {short(uri)}")
    raw = unquote_to_bytes(body)
    if not head.lower().endswith(";base64"):
        return raw
    try:
        return base64.b64decode(b"".join(raw.split()), validate=True)
    except ValueError as error:
        raise ValueError(f"{place}: uri: base64 data is damaged ({error})") from None
