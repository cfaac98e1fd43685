"""What reads the bytes of a file, and small files of its kind: a mesh or scene, or one line, nothing else."""

import io
import os
import tempfile
import zipfile
from collections.abc import Callable
from contextlib import nullcontext, suppress
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

import wive
from support.gltf_files import compressed
from support.mesh_files import WHOLE
from support.refusals import LONGEST, load_or_refusal
from support.scene_files import FILES, threemf_model
from support.threemf_files import package

VERTICES, FACES = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)
HEADER = (
    '{"format": "wive scene", "version": 1, "wive": "0.1.0", "options": {"backend": "scalar", '
    '"device": null, "accuracy": "fast", "nodes": "compressed", "quality": "medium"}}'
)
# They place copies, which may be more than memory holds.
WITH_COPIES = ("3mf", "dae", "glb", "gltf")


class Target(NamedTuple):
    """Files, and what reads them: returns "" or the refusal, fails if there is neither."""

    read: Callable[[bytes], str]
    seeds: list[bytes]


def mesh(kind: str | None, whole: Callable[[bytes], bytes] = bytes) -> Callable[[bytes], str]:
    """The reader of meshes of this kind; `whole` makes the file of the bytes that are damaged."""

    def read(data: bytes) -> str:
        with suppress(MemoryError) if kind in WITH_COPIES else nullcontext():
            return load_or_refusal(whole(data), kind)
        return "too large"

    return read


def scene(data: bytes) -> str:
    """The reader of saved scenes."""
    with tempfile.NamedTemporaryFile(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as file:
        file.write(data)
        file.flush()
        try:
            wive.load(file.name)
        except ValueError as error:
            text = str(error)
            assert text.startswith(f"{file.name}: ") and text.isprintable() and len(text) < LONGEST, text
            return text
    return ""


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def npz(name: str, member: bytes) -> bytes:
    """A saved scene with this member, without compression and with the checksum of what it holds."""
    arrays = {"vertices": VERTICES, "faces": FACES, "header": np.array(HEADER)}
    members = {**{key: npy(array) for key, array in arrays.items()}, name: member}
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for key, data in members.items():
            archive.writestr(f"{key}.npy", data)
    return file.getvalue()


def npz_mesh(member: bytes) -> bytes:
    """A mesh file whose vertices are this member."""
    with io.BytesIO(npz("vertices", member)) as file, zipfile.ZipFile(file) as archive:
        faces = archive.read("faces.npy")
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("vertices.npy", member)
        archive.writestr("faces.npy", faces)
    return out.getvalue()


def header(text: bytes) -> bytes:
    """A saved scene with this header."""
    return npz("header", npy(np.array(text.decode("latin-1"))))


def targets() -> dict[str, Target]:
    """All of them by name: formats, and parts of archives, which checksums guard from damage."""
    files: dict[str, list[bytes]] = {kind: list(seeds) for kind, seeds in WHOLE.items()}
    for kind, make in FILES.values():
        files.setdefault(kind, []).append(make())
    result = {kind: Target(mesh(kind), seeds) for kind, seeds in files.items()}
    result["any"] = Target(mesh(None), [seed for seeds in files.values() for seed in seeds])
    result["3mf-part"] = Target(mesh("3mf", package), [threemf_model().encode()])
    if find_spec("DracoPy"):
        result["glb-draco"] = Target(mesh("glb", lambda data: compressed(data).glb()), draco())
    arrays = [npy(VERTICES), npy(np.asfortranarray(VERTICES, ">f8")), npy(np.eye(3, dtype="u1"))]
    result["npz-array"] = Target(mesh("npz", npz_mesh), arrays)
    result["scene"] = Target(scene, [npz("vertices", npy(VERTICES))])
    result["scene-array"] = Target(lambda data: scene(npz("faces", data)), [npy(FACES)])
    result["scene-header"] = Target(lambda data: scene(header(data)), [HEADER.encode()])
    return result


def draco() -> list[bytes]:
    """The square of `compressed`."""
    import DracoPy

    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return [DracoPy.encode(points, faces=faces, compression_level=level) for level in (0, 10)]
