"""Textures: images that a mesh file names or holds, read by Pillow."""

from __future__ import annotations

import io
from collections.abc import Callable, Hashable

import numpy as np
from numpy.typing import NDArray

from wive._internal.process_lock import without_warnings
from wive._internal.room import expect_room

Texels = NDArray[np.uint8]  # (height,width,3), sRGB, the top row first
# Formats that hold pixels alone: Pillow's others run programs, as EPS does, or follow files.
FORMATS = "PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF", "JPEG2000", "DDS"
MOST_PIXELS = 1 << 26  # 8192 x 8192: a small file may claim any number
MOST_OF_ALL = 1 << 31  # pixels of all textures of a file, which take half a minute
MOST_HELD = 1 << 28  # bytes of textures that are kept for the next triangles
BYTES_OF_PIXEL = 8  # Pillow's, beside those of the array


class Textures:
    """Textures by a key, each read once unless they are too large to be kept together."""

    def __init__(self) -> None:
        """Read nothing yet."""
        self._held: dict[Hashable, Texels | None] = {}
        self._left = MOST_OF_ALL

    def get(self, key: Hashable, find: Callable[[], bytes | str | None]) -> Texels | None:
        """The texture whose bytes or path `find` returns; None if there is none that can be read."""
        if key not in self._held:
            source = find()
            texels = None if source is None else self._read(source)
            held = sum(one.nbytes for one in self._held.values() if one is not None)
            if texels is not None and held + texels.nbytes > MOST_HELD:
                self._held = {key: one for key, one in self._held.items() if one is None}
            self._held[key] = texels
        return self._held[key]

    def _read(self, source: bytes | str) -> Texels | None:
        """The pixels of an image file or of its bytes.

        None without Pillow, and if the image is damaged, of another format or too large: a surface then has
        the colour of its material.
        """
        try:
            from PIL import Image
        except ImportError:
            return None
        file = io.BytesIO(source) if isinstance(source, bytes) else source
        try:
            with without_warnings(), Image.open(file, formats=FORMATS) as image:
                pixels = image.width * image.height
                if not 0 < pixels <= min(MOST_PIXELS, self._left):
                    return None
                self._left -= pixels
                expect_room(BYTES_OF_PIXEL * pixels, np.uint8)
                if image.mode.startswith("I"):  # of 16 bits, of which Pillow would keep the lower
                    gray = np.clip(np.asarray(image).astype(np.int64) >> 8, 0, 255)
                    return np.repeat(gray.astype(np.uint8)[..., None], 3, axis=2)
                return np.array(image.convert("RGB"))
        except MemoryError:
            raise
        except Exception:  # of decoders, which raise what they like on damaged bytes
            return None
