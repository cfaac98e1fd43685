"""glTF files for tests, put together from arrays and pieces of JSON."""

import json
import struct
from typing import Any

import numpy as np

import wive

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
LISTED = [0, 1, 2, 0, 2, 3]
CORNERS = SQUARE[LISTED].reshape(2, 3, 3)
KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def glb(document: dict[str, Any], blob: bytes = b"", more: bytes = b"") -> bytes:
    """A .glb file: the JSON chunk, the BIN chunk, then the bytes `more`."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = chunk(text, 0x4E4F534A)
    if blob:
        body += chunk(blob + b"\0" * (-len(blob) % 4), 0x004E4942)
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(body + more)) + body + more


def chunk(data: bytes, kind: int) -> bytes:
    return struct.pack("<2I", len(data), kind) + data


class Model:
    """A document that grows: `array` adds an accessor, `mesh` a mesh, `node` a node of the scene."""

    def __init__(self) -> None:
        self.blob = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
            "buffers": [{"byteLength": 0}],
        }

    def view(self, data: bytes, **fields: Any) -> int:
        self.blob += b"\xee" * (-len(self.blob) % 4)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **fields}
        )
        self.blob += data
        self.json["buffers"][0]["byteLength"] = len(self.blob)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, **fields: Any) -> int:
        self.json["accessors"].append(fields)
        return len(self.json["accessors"]) - 1

    def array(self, values: Any, dtype: str, **fields: Any) -> int:
        array = np.asarray(values, f"<{dtype}")
        width = 1 if array.ndim == 1 else array.shape[1]
        view = self.view(array.tobytes())
        return self.accessor(
            **{
                "bufferView": view,
                "componentType": KINDS[dtype],
                "count": len(array),
                "type": TYPES[width],
                **fields,
            }
        )

    def mesh(self, *primitives: dict[str, Any], **fields: Any) -> int:
        self.json["meshes"].append({"primitives": list(primitives), **fields})
        return len(self.json["meshes"]) - 1

    def node(self, root: bool = True, **fields: Any) -> int:
        self.json["nodes"].append(fields)
        index = len(self.json["nodes"]) - 1
        if root:
            self.json["scenes"][0]["nodes"].append(index)
        return index

    def glb(self) -> bytes:
        return glb(self.json, self.blob)


def primitive(position: int, indices: int | None = None, **fields: Any) -> dict[str, Any]:
    result = {"attributes": {"POSITION": position}, **fields}
    return result if indices is None else {**result, "indices": indices}


def compressed(data: bytes = b"DRACO", count: int = 4, triangles: int = 2, mode: int = 4) -> Model:
    """A model of one mesh that only Draco data has."""
    model = Model()
    position = model.accessor(componentType=5126, count=count, type="VEC3")
    indices = model.accessor(componentType=5123, count=3 * triangles, type="SCALAR")
    extension = {"bufferView": model.view(data), "attributes": {"POSITION": 0}}
    extensions = {"KHR_draco_mesh_compression": extension}
    model.node(mesh=model.mesh(primitive(position, indices, mode=mode, extensions=extensions)))
    model.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return model


def square(dtype: str = "u2") -> tuple[Model, int, int]:
    """A model with a square's positions and indices, in accessors 0 and 1, and no mesh."""
    model = Model()
    return model, model.array(SQUARE, "f4"), model.array(LISTED, dtype)


def corners(data: bytes, dtype=np.float64) -> np.ndarray:
    vertices, faces = wive.load_mesh(data, dtype)
    return vertices[faces]
