"""npz files of two arrays, `vertices` and `faces`."""

from __future__ import annotations

import io

from wive._internal.formats import Mesh
from wive._internal.npzfile import Npz

EXPECTED = "an npz file of arrays `vertices` and `faces`"


def read(data: bytes, name: str) -> Mesh:
    """Read the two arrays; no other one is unpacked."""
    arrays = Npz(io.BytesIO(data), name, EXPECTED)
    if not {"vertices", "faces"} <= arrays.keys():
        raise ValueError(
            f"{name}: expected arrays `vertices` and `faces`, found {arrays.listed()}: "
            "save them by np.savez(file, vertices=..., faces=...)"
        )
    return arrays["vertices"], arrays["faces"]
