"""Textures: images that a mesh file names or holds, read by Pillow."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Hashable

import numpy as np
from numpy.typing import NDArray

from wive._internal.room import expect_room

Texels = NDArray[np.uint8]  # (height,width,3), sRGB, the top row first
# Formats that hold pixels alone: Pillow's others run programs, as EPS does, or follow files.
FORMATS = "PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF", "JPEG2000", "DDS"
MOST_PIXELS = 1 << 26  # 8192 x 8192: a small file may claim any number
MOST_HELD = 1 << 28  # bytes of textures that are kept for the next triangles
BYTES_OF_PIXEL = 8  # Pillow's, beside those of the array


class Textures:
    """Textures by a key, each read once unless they are too many to be kept."""

    def __init__(self) -> None:
        """Read nothing yet."""
        self._held: dict[Hashable, Texels | None] = {}

    def get(self, key: Hashable, find: Callable[[], bytes | str | None]) -> Texels | None:
        """The texture whose bytes or path `find` returns; None if there is none that can be read."""
        if key not in self._held:
            source = find()
            texels = None if source is None else read_texture(source)
            held = sum(one.nbytes for one in self._held.values() if one is not None)
            if texels is not None and held + texels.nbytes > MOST_HELD:
                self._held = {key: one for key, one in self._held.items() if one is None}
            self._held[key] = texels
        return self._held[key]


def read_texture(source: bytes | str) -> Texels | None:
    """The pixels of an image file or of its bytes.

    None without Pillow, and if it is damaged, of another format or of more than MOST_PIXELS: a surface then
    has the colour of its material.
    """
    try:
        from PIL import Image
    except ImportError:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(
                io.BytesIO(source) if isinstance(source, bytes) else source, formats=FORMATS
            ) as image:
                width, height = image.size
                if not 0 < width * height <= MOST_PIXELS:
                    return None
                expect_room(BYTES_OF_PIXEL * width * height, np.uint8)
                if image.mode.startswith("I"):  # of 16 bits, of which Pillow would keep the lower
                    gray = np.asarray(image).astype(np.int64) >> 8
                    return np.repeat(np.clip(gray, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
                return np.array(image.convert("RGB"))
    except MemoryError:
        raise
    except Exception:  # of decoders, which raise what they like on damaged bytes
        return None
