"""Picture files: PNG for the eye; EXR, HDR, TIFF and NPY for numbers."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments
from wive._internal.files import PathLike, atomic_write, check_output
from wive._internal.host_arrays import host_array
from wive._internal.picture import Image

# The nearest surface in a PNG of depth is white, the farthest this gray, and nothing black.
FARTHEST = 0.1
# What a format needs beyond NumPy: a module, the package that brings it, and wive's extra.
PILLOW = "PIL.Image", "Pillow", "render"
OPENEXR = "OpenEXR", "OpenEXR", "images"
TIFFFILE = "tifffile", "tifffile", "images"


def write_picture(path: PathLike, image: ArrayLike, *, srgb: bool = True) -> None:
    """Write a picture, or a map of depth, to a file whose extension says the format; it is whole or absent.

    Arguments:
        path: PNG (8 bits; values above 1 are white), EXR, TIFF (.tif, .tiff) and NPY (float32, as it is), or
            HDR (Radiance RGBE: no negative values). PNG needs Pillow, EXR OpenEXR, TIFF tifffile.
        image: (h,w,3) linear radiance or colours, or (h,w) depth as `render` returns it: in a PNG white is
            near, dark gray far, and black nothing; HDR files hold no depth.
        srgb: for PNG: whether (h,w,3) are linear and are encoded for a screen. False writes 255 times the
            value, as for normals.

    Raises ValueError or TypeError that names a bad argument, ImportError with the command that installs a
    missing package, OSError if the file can't be written.
    """
    name, values = check_picture_output(path), _values(image)
    writer = FORMATS[_suffix(name)][0]
    writer(name, values, arguments.flag("srgb", srgb))


def check_picture_output(path: PathLike, inputs: Iterable[PathLike | None] = (), shading: str = "") -> str:
    """Raise unless `write_picture` can write to `path`, none of `inputs`; call it before rendering."""
    name = check_output(path, tuple(FORMATS), inputs)
    suffix = _suffix(name)
    if shading == "depth" and suffix == ".hdr":
        raise ValueError(f"{name}: {NO_DEPTH}")
    needed = FORMATS[suffix][1]
    if needed is not None:
        _imported(suffix, *needed)
    return name


NO_DEPTH = "HDR files hold no depth: write it to .exr, .tiff, .npy or .png"


def write_png(path: PathLike, image: Image, srgb: bool = True) -> None:
    """Write linear radiance as an 8-bit sRGB PNG; values above 1 are white. The file is whole or absent."""
    # In memory first: Pillow doesn't say why it can't write to a file.
    content = png_bytes(image, srgb)
    with atomic_write(path) as file:
        file.write(content)


def png_bytes(image: Image, srgb: bool = True) -> bytes:
    """The content of a PNG file."""
    pillow = _imported(".png", *PILLOW)
    levels = np.empty(image.shape, np.uint8)
    shown: Image = image if image.ndim == 3 else _shades_of_depth(image)
    for row, linear in zip(levels, shown, strict=True):  # row by row: less memory than the picture takes
        within = np.clip(np.nan_to_num(linear, nan=0.0), 0, 1)
        row[:] = (_encoded(within) if srgb and image.ndim == 3 else within) * 255 + 0.5
    content = io.BytesIO()
    pillow.fromarray(levels).save(content, format="PNG", optimize=True)
    return content.getvalue()


def _encoded(linear: Image) -> Image:
    """IEC 61966-2-1, the sRGB transfer function."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _shades_of_depth(depth: Image) -> Image:
    """(h,w) from 0 to 1: 1 is the nearest."""
    there = np.isfinite(depth)
    if not there.any():
        return np.zeros_like(depth)
    near, far = float(depth[there].min()), float(depth[there].max())
    share = (np.where(there, depth, far) - near) / ((far - near) or 1.0)
    return np.where(there, 1 - (1 - FARTHEST) * share, 0).astype(np.float32)


def _write_exr(name: str, image: Image, srgb: bool) -> None:
    import tempfile

    openexr = _imported(".exr", *OPENEXR)
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    with tempfile.TemporaryDirectory(prefix="wive-") as folder:  # the library writes to names alone
        part = os.path.join(folder, "picture.exr")
        try:
            openexr.File(header, {"RGB" if image.ndim == 3 else "Z": image}).write(part)
        except RuntimeError as error:
            raise OSError(f"{name}: {' '.join(str(error).split()):.120}") from error
        with open(part, "rb") as written, atomic_write(name) as file:
            while block := written.read(1 << 20):
                file.write(block)


def _write_tiff(name: str, image: Image, srgb: bool) -> None:
    kind = "rgb" if image.ndim == 3 else "minisblack"
    tifffile = _imported(".tiff", *TIFFFILE)
    content = io.BytesIO()  # the library asks files for their names
    tifffile.imwrite(content, image, photometric=kind, software="wive")
    with atomic_write(name) as file:
        file.write(content.getvalue())


def _write_npy(name: str, image: Image, srgb: bool) -> None:
    with atomic_write(name) as file:
        np.save(file, image, allow_pickle=False)


def _write_hdr(name: str, image: Image, srgb: bool) -> None:
    if image.ndim == 2:
        raise ValueError(f"{name}: {NO_DEPTH}")
    height, width = image.shape[:2]
    with atomic_write(name) as file:
        file.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width))
        for row in image:
            _write_rgbe(file, row)


def _write_rgbe(file: BinaryIO, row: Image) -> None:
    """A row of pixels, 4 bytes each: three mantissas with one exponent, Ward 1991; not run-length encoded."""
    values = np.clip(np.nan_to_num(row, nan=0.0), 0, np.ldexp(255 / 256, 127)).astype(np.float64)
    _, exponent = np.frexp(values.max(axis=1))
    exponent = np.where(values.max(axis=1) < 1e-38, -128, exponent)
    mantissas = np.floor(np.ldexp(values, 8 - exponent[:, None]))
    pixels = np.empty((len(row), 4), np.uint8)
    pixels[:, :3] = np.where(exponent[:, None] == -128, 0, mantissas)
    pixels[:, 3] = exponent + 128
    file.write(pixels.tobytes())


def _write_png(name: str, image: Image, srgb: bool) -> None:
    write_png(name, image, srgb)


Writer = Callable[[str, Image, bool], None]
FORMATS: dict[str, tuple[Writer, tuple[str, str, str] | None]] = {
    ".png": (_write_png, PILLOW),
    ".exr": (_write_exr, OPENEXR),
    ".hdr": (_write_hdr, None),
    ".npy": (_write_npy, None),
    ".tif": (_write_tiff, TIFFFILE),
    ".tiff": (_write_tiff, TIFFFILE),
}


def _suffix(name: str) -> str:
    return os.path.splitext(name)[1].lower()


def _imported(suffix: str, module: str, package: str, extra: str) -> Any:
    try:
        return import_module(module)
    except ImportError:
        raise ImportError(
            f'writing {suffix[1:].upper()} pictures needs {package}: pip install "wive[{extra}]"'
        ) from None


def _values(image: ArrayLike) -> NDArray[np.float32]:
    array = arguments.nan_if_masked(arguments.array_of_numbers("image", host_array("image", image)))
    if array.ndim not in (2, 3) or array.shape[2:] not in ((), (3,)) or array.size == 0:
        raise ValueError(f"image must have shape (h, w, 3) or (h, w), got {array.shape}")
    if array.dtype.kind != "f":
        raise TypeError(f"image must be floats, got dtype {array.dtype}: divide 8-bit values by 255")
    with np.errstate(over="ignore"):  # numbers beyond float32 are infinite
        return np.ascontiguousarray(array, np.float32)
