"""Meshes compressed by Draco: KHR_draco_mesh_compression, unpacked by DracoPy.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_draco_mesh_compression
"""

from __future__ import annotations

import numpy as np

from wive._internal.formats.gltf.accessors import describe
from wive._internal.formats.gltf.document import Document
from wive._internal.formats.gltf.fields import Fields, index_of, members, whole

NAME = "KHR_draco_mesh_compression"
TRIANGLES = 4


def is_compressed(document: Document, primitive: Fields, place: str) -> bool:
    """Whether a primitive's arrays are only in its Draco data; many files have them in plain form as well."""
    if NAME not in members(primitive, "extensions", place):
        return False
    used = (
        index_of(members(primitive, "attributes", place), "POSITION", place),
        index_of(primitive, "indices", place),
    )
    return any(
        index is not None and "bufferView" not in document.item("accessors", index, place) for index in used
    )


def unpack(document: Document, primitive: Fields, place: str) -> None:
    """Put the arrays of a compressed primitive in place of those of its accessors.

    Raises ImportError without DracoPy, ValueError if its data is damaged or not what the accessors say.
    """
    here = f"{place}: {NAME}"
    try:
        import DracoPy
    except ImportError:
        raise ImportError(
            f'{here}: needs DracoPy: pip install "wive[draco]", or export the model without mesh compression'
        ) from None
    if whole(primitive, "mode", place, TRIANGLES) != TRIANGLES:
        raise ValueError(f"{here}: expected mode {TRIANGLES}, triangles")
    extension = members(members(primitive, "extensions", place), NAME, place)
    data, _ = document.view(whole(extension, "bufferView", here), here)
    try:
        mesh = DracoPy.decode(bytes(data))
    except MemoryError:
        raise
    except Exception as error:  # of DracoPy's own kinds
        raise ValueError(f"{here}: {error}: the file is damaged") from None
    listed = index_of(primitive, "indices", place)
    if listed is None or not len(getattr(mesh, "faces", ())):
        raise ValueError(f"{here}: expected indices and a mesh: the file is damaged")
    arrays = {listed: np.asarray(mesh.faces).reshape(-1, 1).astype(np.uint32)}
    found = {one["unique_id"]: one["data"] for one in mesh.attributes}
    ids = members(extension, "attributes", here)
    for key, value in members(primitive, "attributes", place).items():
        unique = index_of(ids, key, here)
        if unique is not None and type(value) is int:
            if unique not in found:
                raise ValueError(f"{here}: {key}: its data has no attribute {unique}: the file is damaged")
            arrays[value] = np.asarray(found[unique])
            if arrays[value].ndim != 2:  # None for types that glTF does not have
                raise ValueError(f"{here}: {key}: its data has a type that is not read: the file is damaged")
    for index, array in arrays.items():
        fields = document.item("accessors", index, here)
        accessor = describe(document, index, here, str(fields.get("type")))
        if len(array) != accessor.count:
            raise ValueError(
                f"{accessor.place}: count: expected {len(array)}, as {here} has, found {accessor.count}"
            )
        document.arrays[index] = array
