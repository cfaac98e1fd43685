"""The one line that refuses a mesh file."""

import pytest

import wive


def refusal(data: bytes | str, kind: str | None = None) -> str:
    """The message of the ValueError after the file name, with which it must begin, on one line."""
    with pytest.raises(ValueError) as error:
        wive.load_mesh(data.encode() if isinstance(data, str) else data, file_type=kind)
    text = str(error.value)
    assert text.isprintable() and text.startswith("mesh (bytes): ")
    return text.removeprefix("mesh (bytes): ")
