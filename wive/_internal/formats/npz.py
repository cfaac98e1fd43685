"""npz files of two arrays, `vertices` and `faces`."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from wive._internal.formats import Mesh

EXPECTED = "an npz file of arrays `vertices` and `faces`"
# Deflate never makes more than this many bytes of one: a longer claim is false.
MOST_INFLATION = 1032


def read(data: bytes, name: str) -> Mesh:
    """Read the two arrays; no other one is unpacked."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {file.filename.removesuffix(".npy"): file for file in archive.infolist()}
            found = {key: _content(archive, members[key]) for key in ("vertices", "faces") if key in members}
    except MemoryError:
        raise
    except Exception as error:  # damaged archives raise errors of many kinds
        raise _damaged(name) from error
    if len(found) < 2:
        listed = ", ".join(key if key.isidentifier() else ascii(key) for key in sorted(members)) or "none"
        raise ValueError(
            f"{name}: expected arrays `vertices` and `faces`, found {listed:.100}: "
            "save them by np.savez(file, vertices=..., faces=...)"
        )
    return _array("vertices", found["vertices"], name), _array("faces", found["faces"], name)


def _damaged(name: str) -> ValueError:
    return ValueError(f"{name}: not {EXPECTED}, or damaged")


def _content(archive: zipfile.ZipFile, file: zipfile.ZipInfo) -> bytes:
    """A member's bytes; an error, before any are made, if it can't have as many as it claims."""
    if file.file_size > MOST_INFLATION * (file.compress_size + 1):
        raise ValueError
    return archive.read(file)


def _array(array_name: str, content: bytes, name: str) -> NDArray[Any]:
    """One array; the size that its header claims is compared with its bytes before anything is allocated."""
    stream = io.BytesIO(content)
    try:
        version = npy.read_magic(stream)
        header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, fortran, dtype = header(stream)
    except Exception as error:  # NumPy raises anything on a damaged header: tokenizer errors among others
        raise _damaged(name) from error
    if dtype.kind not in "iuf":
        raise ValueError(f"{name}: `{array_name}` must hold numbers, got dtype {dtype!s:.60}")
    count = 1
    for side in shape:
        count *= side
    if any(side < 0 for side in shape) or count * dtype.itemsize != len(content) - stream.tell():
        raise _damaged(name)
    flat = np.frombuffer(content, dtype, offset=stream.tell())
    return flat.reshape(shape, order="F" if fortran else "C")
