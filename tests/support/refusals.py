"""The one line that refuses a mesh file."""

import numpy as np
import pytest

import wive

LONGEST = 600


def refusal(data: bytes | str, kind: str | None = None) -> str:
    """The message of the ValueError after the file name, with which it must begin, on one line."""
    text = load_or_refusal(data.encode() if isinstance(data, str) else data, kind)
    if not text:
        pytest.fail("the file was read")
    return text


def load_or_refusal(data: bytes, kind: str | None, dtype: type = np.float32) -> str:
    """The message that refuses the file, without its name; "" if there is a mesh that a scene takes.

    Fails at any other error, and at a message that is not on one line.
    """
    try:
        vertices, faces = wive.load_mesh(data, dtype, file_type=kind)
    except (ValueError, ImportError) as error:
        text = str(error)
        assert text.isprintable() and text.startswith("mesh (bytes): "), text
        assert len(text) < LONGEST, text
        return text.removeprefix("mesh (bytes): ")
    assert vertices.dtype == dtype and faces.dtype == np.int32
    assert vertices.shape[1:] == faces.shape[1:] == (3,) and len(faces)
    assert faces.min() >= 0 and faces.max() < len(vertices)
    assert np.isfinite(vertices[faces]).all()
    return ""
