"""glTF accessors: arrays in buffers, with strides, offsets, sparse replacements and normalised integers.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, sections 3.6.2 and 3.11.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.archives import MOST_INFLATION
from wive._internal.formats.gltf.document import Document
from wive._internal.formats.gltf.fields import Fields, index_of, short, whole
from wive._internal.formats.placing import MOST

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# Zeros that take no bytes of the file: not more than deflate would make of it, or this.
LEAST_CLAIM = 1 << 24


@dataclass(frozen=True)
class Accessor:
    """What an accessor says of its array, checked; `fields` has where the values are."""

    index: int
    place: str
    fields: Fields
    count: int
    kind: str
    dtype: np.dtype[Any]
    normalized: bool


def describe(document: Document, index: int, place: str, kind: str) -> Accessor:
    """Accessor `index`, which `place` refers to; raises ValueError unless its type is `kind`."""
    here = f"accessors[{index}]"
    fields = document.item("accessors", index, place)
    count = whole(fields, "count", here)
    if count > MOST:
        raise ValueError(f"{here}: count: expected at most {MOST}, found {count}")
    if fields.get("type") != kind:
        raise ValueError(f"{here}: type: expected {kind!r} for {place}, found {short(fields.get('type'))}")
    dtype, normalized = component(fields, here), fields.get("normalized", False)
    if not isinstance(normalized, bool) or (normalized and dtype.itemsize == 4):
        raise ValueError(f"{here}: normalized: expected true for integers of 8 or 16 bits only, or false")
    return Accessor(index, here, fields, count, kind, dtype, normalized)


def component(fields: Fields, place: str) -> np.dtype[Any]:
    """The dtype of a componentType."""
    value = whole(fields, "componentType", place)
    if value not in COMPONENTS:
        raise ValueError(
            f"{place}: componentType: expected one of {', '.join(map(str, COMPONENTS))}, found {value}"
        )
    return np.dtype(COMPONENTS[value])


def values(document: Document, accessor: Accessor) -> NDArray[Any]:
    """The array (count, width) in the dtype of its components, or in float64 if they are normalised.

    The array is a read-only view into the file if it may be.
    """
    width = WIDTHS[accessor.kind]
    base = index_of(accessor.fields, "bufferView", accessor.place)
    if accessor.index in document.arrays:
        array = document.arrays[accessor.index]
        if array.shape[1:] != (width,) or array.dtype.kind != ("u" if width == 1 else accessor.dtype.kind):
            raise ValueError(f"{accessor.place}: its compressed data is not of its type: the file is damaged")
    elif base is None:  # zeros, for sparse values to replace
        size = accessor.count * width * accessor.dtype.itemsize
        if size > max(LEAST_CLAIM, MOST_INFLATION * document.size):
            raise ValueError(
                f"{accessor.place}: claims {accessor.count} values without a bufferView, {size} bytes in a "
                f"file of {document.size}"
            )
        array = np.zeros((accessor.count, width), accessor.dtype)
    else:
        start = whole(accessor.fields, "byteOffset", accessor.place, 0)
        array = slots(document, base, start, (accessor.count, width), accessor.dtype, accessor.place)
    if "sparse" in accessor.fields:
        array = replaced(document, accessor, array)
    if accessor.normalized:  # section 3.11: -128 and -127 are both -1
        most = np.iinfo(accessor.dtype).max
        return np.maximum(array.astype(np.float64) / most, -1.0)
    return array


def replaced(document: Document, accessor: Accessor, array: NDArray[Any]) -> NDArray[Any]:
    """A copy of the array with the rows that the accessor's sparse values replace."""
    place = f"{accessor.place}: sparse"
    sparse = accessor.fields["sparse"]
    if not isinstance(sparse, dict) or not all(
        isinstance(sparse.get(k), dict) for k in ("indices", "values")
    ):
        raise ValueError(f"{place}: expected an object of count, indices and values, found {short(sparse)}")
    count, at, by = whole(sparse, "count", place), sparse["indices"], sparse["values"]
    kind = component(at, f"{place}: indices")
    if kind.kind != "u":
        raise ValueError(
            f"{place}: indices: componentType: expected unsigned integers, found {at['componentType']}"
        )
    rows = slots(
        document,
        whole(at, "bufferView", f"{place}: indices"),
        whole(at, "byteOffset", f"{place}: indices", 0),
        (count, 1),
        kind,
        f"{place}: indices",
    )[:, 0].astype(np.int64)
    if (np.diff(rows) <= 0).any() or (count and rows[-1] >= accessor.count):
        raise ValueError(
            f"{place}: indices: expected ascending numbers below {accessor.count}: the file is damaged"
        )
    array = array.copy()
    array[rows] = slots(
        document,
        whole(by, "bufferView", f"{place}: values"),
        whole(by, "byteOffset", f"{place}: values", 0),
        (count, array.shape[1]),
        accessor.dtype,
        f"{place}: values",
    )
    return array


def slots(
    document: Document, view: int, start: int, shape: tuple[int, int], dtype: np.dtype[Any], place: str
) -> NDArray[Any]:
    """Rows of a buffer view from byte `start` on, each a stride after the one before it, without a copy."""
    data, stride = document.view(view, place)
    size = shape[1] * dtype.itemsize
    if stride and stride < size:
        raise ValueError(
            f"bufferViews[{view}]: byteStride: expected at least the {size} bytes of {place}, found {stride}"
        )
    stride = stride or size
    end = start + (shape[0] - 1) * stride + size if shape[0] else 0
    if end > len(data):
        raise ValueError(
            f"{place}: its {shape[0]} values end at byte {end} of bufferViews[{view}], expected at most "
            f"{len(data)}: the file is damaged"
        )
    if not shape[0]:
        return np.empty(shape, dtype)
    return np.ndarray(shape, dtype, data, start, (stride, dtype.itemsize))
