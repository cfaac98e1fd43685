"""npz files of arrays in parts, as batches return them, written without joining them in memory."""

from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray


def write_npz(file: BinaryIO, arrays: Mapping[str, Sequence[NDArray[Any]]]) -> None:
    """Write arrays by name as `np.savez` does, each joined of its parts, at least one."""
    import zipfile

    with zipfile.ZipFile(file, "w") as archive:
        for name, parts in arrays.items():
            first = parts[0]
            header = {
                "descr": np.lib.format.dtype_to_descr(first.dtype),
                "fortran_order": False,
                "shape": (sum(map(len, parts)), *first.shape[1:]),
            }
            # An array's size may pass 4 GiB, which a member of the first kind can't hold.
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, header)
                for part in parts:
                    member.write(part.tobytes())
