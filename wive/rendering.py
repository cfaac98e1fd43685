"""Pictures: path tracing in bands of rows, and PNG files of them."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from typing import Literal

import numpy as np

from wive import _cpu
from wive._internal import arguments
from wive._internal.files import PathLike, atomic_write, check_output
from wive._internal.picture import Image, Settings
from wive._internal.progress import progress_bar
from wive.camera import Camera
from wive.scene import Scene
from wive.sensors import PinholeCamera

# Paths per band: some tenths of a second, so that the bar moves; Ctrl-C takes effect between bands.
BAND_PATHS = 300_000
CUDA_BAND_PATHS = 1 << 20


def render(
    scene: Scene,
    camera: Camera | PinholeCamera | None = None,
    *,
    width: int = 1280,
    height: int = 720,
    spp: int = 32,
    bounces: int = 8,
    albedo: Literal["gray", "normals"] = "gray",
    seed: int = 0,
    threads: int | None = None,
    progress: bool = False,
) -> Image:
    """Path-trace a picture of diffuse surfaces under a white sky of radiance 1.

    Arguments:
        camera: None frames the whole scene.
        width, height: in pixels.
        spp: samples (paths) per pixel.
        bounces: diffuse bounces after which a path ends.
        albedo: "gray", or "normals" for surfaces coloured by their normal.
        seed: another seed gives another picture of the same noise level. Random numbers come from (seed,
            pixel, sample, bounce) alone, so the picture depends on neither `threads` nor the scene's backend.
        threads: how many to use; None is every core. For CPU backends.
        progress: show a progress bar on stderr (needs tqdm).

    Returns (height, width, 3) float32 linear radiance, top row first. Raises ValueError or TypeError that
    names a bad argument, such as a float64 scene: only float32 scenes are rendered.
    """
    settings = Settings(
        width=width, height=height, spp=spp, bounces=bounces, albedo=albedo, seed=seed, threads=threads
    )
    return render_counted(scene, camera, settings, progress=arguments.flag("progress", progress))[0]


def render_counted(
    scene: Scene, camera: Camera | PinholeCamera | None, settings: Settings, *, progress: bool
) -> tuple[Image, int]:
    """The picture that `render` returns, and how many rays were traced for it."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene must be a wive.Scene, got {type(scene).__name__}")
    if not (camera is None or isinstance(camera, Camera | PinholeCamera)):
        raise TypeError(
            "camera must be a wive.Camera or wive.PinholeCamera, or None to frame the scene, "
            f"got {type(camera).__name__}"
        )
    if scene.precision != "float32":
        raise ValueError(
            "scene must be of float32 vertices to be rendered, got float64: "
            "make one with (vertices - vertices.mean(axis=0)).astype(np.float32)"
        )
    width, height = settings.width, settings.height
    if camera is None:
        camera = Camera.framing(scene.bounds, aspect=width / height)
    frame = camera.frame(width, height)
    _cpu.expect_memory(height * width * 3 * np.dtype(np.float32).itemsize)
    image = np.zeros((height, width, 3), np.float32)
    tracer = scene._tracer  # one picture shows one shape, whatever refits happen meanwhile
    arguments.refuse_lacking(tracer.backend, tracer.lacks, {"threads": settings.threads})
    render_rows = tracer.rows_renderer(frame, image, settings)
    rays = 0
    with progress_bar(height, "row", "rendering", show=progress) as advance:
        for begin, end in _bands(height, width * settings.spp, scene.device):
            rays += render_rows(begin, end)
            advance(end - begin)
    return image, rays


def check_png_output(path: PathLike, inputs: Iterable[PathLike | None] = ()) -> str:
    """Raise unless `write_png` can write to `path`, none of the files `inputs`: call it before rendering."""
    name = check_output(path, ".png", inputs)
    try:
        import PIL.Image  # noqa: F401
    except ImportError:
        raise ImportError('writing pictures needs Pillow: pip install "wive[render]"') from None
    return name


def write_png(path: PathLike, image: Image) -> None:
    """Write linear radiance as an 8-bit sRGB PNG; values above 1 are white. The file is whole or absent."""
    from PIL import Image as pillow

    levels = np.empty(image.shape, np.uint8)
    for row, linear in zip(levels, image, strict=True):  # row by row: less memory than the picture takes
        row[:] = _encoded(np.clip(linear, 0, 1)) * 255 + 0.5
    # In memory first: Pillow doesn't say why it can't write to a file.
    content = io.BytesIO()
    pillow.fromarray(levels).save(content, format="PNG", optimize=True)
    with atomic_write(path) as file:
        file.write(content.getbuffer())


def _encoded(linear: Image) -> Image:
    """IEC 61966-2-1, the sRGB transfer function."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _bands(height: int, row_paths: int, device: str | None) -> Iterator[tuple[int, int]]:
    paths = BAND_PATHS if device in (None, "cpu") else CUDA_BAND_PATHS
    rows = max(1, paths // row_paths)
    for begin in range(0, height, rows):
        yield begin, min(begin + rows, height)
