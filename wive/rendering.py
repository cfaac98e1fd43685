"""Pictures of scenes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.picture import Colours, How, Image, Look, Settings, Shading
from wive._internal.pictures.albedo import Albedo, albedo_of
from wive._internal.pictures.daylight import light_of, up_of_frame
from wive._internal.pictures.image_files import write_picture as write_picture
from wive._internal.pictures.image_files import write_png as write_png
from wive._internal.pictures.shades import AmbientOcclusion, Headlight, NormalColours, render_depth
from wive._internal.pictures.surroundings import Sight, reaches_sky, stands_inside
from wive._internal.pictures.viewpoint import default_camera
from wive._internal.progress import progress_bar
from wive.camera import Camera, unit_vector
from wive.scene import Scene
from wive.sensors import PinholeCamera

if TYPE_CHECKING:
    from typing_extensions import Unpack

Perspective = Camera | PinholeCamera
# Paths per band: some tenths of a second, so that the bar moves; Ctrl-C takes effect between bands.
BAND_PATHS = 300_000
CUDA_BAND_PATHS = 1 << 20
EXPOSABLE = "path", "ao", "headlight"
# Brightness of the tenth brightest part of a picture with automatic exposure.
EXPOSED = 0.7
# Of the mean distance from an eye inside to what surrounds it: the reach of ambient occlusion there.
INDOOR_REACH = 1.3


def render(
    scene: Scene,
    camera: Perspective | None = None,
    *,
    shading: Shading = "auto",
    width: int = 1280,
    height: int = 720,
    spp: int = 32,
    albedo: Colours = None,
    seed: int = 0,
    threads: int | None = None,
    progress: bool = False,
    **how: Unpack[How],
) -> Image:
    """A picture of the scene.

    Arguments:
        camera: None is `Camera.showing(scene)`: it frames the scene from outside, or stands in the room that
            the scene is.
        shading: "path", path tracing of diffuse surfaces under the sky; "ao", ambient occlusion; "headlight",
            the cosine between view and normal; "normals", (normal + 1) / 2; "depth", along the camera's axis.
            "auto" is "path", but "ao" where that would be dark or fail: the camera stands inside, no path
            reaches the sky, or the scene is float64.
        width, height: in pixels.
        spp: samples per pixel: paths, or rays of ambient occlusion.
        albedo: what surfaces reflect: linear colours from 0 to 1, (v,3) per vertex, (f,3) per triangle or
            (3,) for all, such as `load_colors` returns; or uint8, sRGB, as trimesh has them. If there are as
            many vertices as triangles, (f,1,3) is per triangle. "gray" is 0.6, "normals" is coloured by
            normal. None is gray in "path", white in "ao" and "headlight". Of no use for other shadings.
        seed: another seed gives another picture of the same noise level. Random numbers come from (seed,
            pixel, sample, bounce) alone, so the picture depends on neither `threads` nor the scene's backend.
        threads: how many to use; None is every core. For CPU backends.
        progress: show a progress bar (needs tqdm).
        bounces: 8 unless given: diffuse bounces after which a path ends.
        sky: "day" unless given, blue with a sun; "cloudy"; "white", of radiance 1 everywhere; "black". For
            "path".
        sun: (3,) direction towards the sun, under any sky; None is on the left of the camera by day.
        exposure: 0 unless given: stops, powers of two by which the picture is brighter; "auto" makes most of
            it visible. For "path", "ao" and "headlight".
        reach: for "ao": the distance from which on a surface occludes nothing; one at half of it occludes by
            half. None is inf, or if the camera stands inside, in proportion to the room.

    Returns (height, width, 3) float32 linear radiance, top row first; of "normals" colours; of "depth"
    (height, width) float32, inf if nothing is there. `write_picture` writes them to files.

    Raises ValueError or TypeError that names a bad argument, such as a float64 scene for "path".

    >>> wive.write_picture("room.png", wive.render(scene, shading="ao"))
    """
    unknown = how.keys() - How.__annotations__.keys()
    if unknown:
        raise TypeError(f"render() got an unexpected keyword argument {min(unknown)!r}")
    settings = Settings(
        shading=shading,
        width=width,
        height=height,
        spp=spp,
        albedo=albedo,
        seed=seed,
        threads=threads,
        **how,
    )
    return render_counted(scene, camera, settings, progress=arguments.flag("progress", progress)).image


class Picture(NamedTuple):
    """A picture, how it was shaded, and how many rays were traced for it."""

    image: Image
    shading: str
    rays: int


def render_counted(
    scene: Scene, camera: Perspective | None, settings: Settings, *, progress: bool
) -> Picture:
    """The picture that `render` returns."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene must be a wive.Scene, got {type(scene).__name__}")
    if not (camera is None or isinstance(camera, Perspective)):
        raise TypeError(
            "camera must be a wive.Camera or wive.PinholeCamera, or None for one that shows the scene, "
            f"got {type(camera).__name__}"
        )
    if settings.shading == "path" and scene.precision != "float32":
        raise ValueError(
            "scene must be of float32 vertices to be path-traced, got float64: use another shading, or "
            "make one with (vertices - vertices.mean(axis=0)).astype(np.float32)"
        )
    with _cpu.DefaultFloats():  # the caller's floating-point environment would round otherwise
        return _rendered(scene._at_rest(), camera, settings, progress)


def _rendered(scene: Scene, camera: Perspective | None, settings: Settings, progress: bool) -> Picture:
    """The picture of a scene that no refit changes meanwhile."""
    arguments.refuse_lacking(scene.backend, scene._tracer.lacks, {"threads": settings.threads})
    albedo = albedo_of(settings.albedo, scene)
    width, height = settings.width, settings.height
    channels = () if settings.shading == "depth" else (3,)
    _cpu.expect_memory(height * width * 3 * np.dtype(np.float32).itemsize)
    image = np.zeros((height, width, *channels), np.float32)
    if camera is None:
        camera = default_camera(scene, aspect=width / height, threads=settings.threads)
    frame = camera._frame(width, height)
    shading, reach = _resolved(scene, frame, settings)
    title = "rendering"
    if shading == "path":
        look = _look(settings, albedo, frame, camera)
        with progress_bar(height, "row", title, show=progress) as advance:
            rays = _trace_paths(scene, frame.astype(np.float32), image, look, advance)
    else:
        with progress_bar(height, "row", title, show=progress) as advance:
            rays = _shade(scene, frame, image, shading, albedo, reach, settings, advance)
    if shading in EXPOSABLE:
        _expose(image, settings.exposure)
    return Picture(image, shading, rays)


def _resolved(scene: Scene, frame: NDArray[np.float64], settings: Settings) -> tuple[str, float]:
    """The shading that "auto" means, and the reach of ambient occlusion that None means."""
    shading, reach, sight = settings.shading, settings.reach, Sight(scene, settings.threads)
    if shading not in ("auto", "ao") or (shading == "ao" and reach is not None):
        return shading, np.inf if reach is None else reach
    inside, around = stands_inside(sight, frame[0])
    if reach is None:
        reach = INDOOR_REACH * around if inside else np.inf
    if shading == "auto":
        is_dark = inside or scene.precision != "float32" or not reaches_sky(sight, frame, settings.bounces)
        shading = "ao" if is_dark else "path"
    return shading, reach


def _shade(
    scene: Scene,
    frame: NDArray[np.float64],
    image: Image,
    shading: str,
    albedo: Albedo,
    reach: float,
    settings: Settings,
    advance: Callable[[int], object],
) -> int:
    """Render by the scene's queries."""
    spp, threads = settings.spp, settings.threads
    if shading == "depth":
        return render_depth(image, frame, scene, threads, advance)
    kinds = {"normals": NormalColours, "headlight": Headlight}
    shader = (
        AmbientOcclusion(scene, albedo, settings.seed, threads, reach, spp)
        if shading == "ao"
        else kinds[shading](scene, albedo, settings.seed, threads)
    )
    return shader.render(image, frame, spp, advance)


def _look(settings: Settings, albedo: Albedo, frame: NDArray[np.float64], camera: Perspective) -> Look:
    up = up_of_frame(frame) if isinstance(camera, PinholeCamera) else unit_vector("up", camera.up)
    light = light_of(settings.sky, settings.sun, frame, up)
    kind = "gray" if albedo.kind == "none" else albedo.kind
    threads = arguments.threads(settings.threads)
    return Look(settings.spp, settings.bounces, kind, albedo.colours, light, settings.seed, threads)


def _trace_paths(
    scene: Scene, frame: Image, image: Image, look: Look, advance: Callable[[int], object]
) -> int:
    render_rows = scene._tracer.rows_renderer(frame, image, look)
    rays = 0
    for begin, end in _bands(len(image), image.shape[1] * look.spp, scene.device):
        rays += render_rows(begin, end)
        advance(end - begin)
    return rays


def _expose(image: Image, exposure: float | str) -> None:
    """Multiply the picture in place."""
    if exposure == "auto":
        middle = image[:, :, 1]  # green is most of the luminance
        bright = float(np.quantile(middle, 0.9))
        factor = EXPOSED / bright if bright > 0 else 1.0
    else:
        factor = 2.0 ** float(exposure)
    if factor != 1:
        with np.errstate(over="ignore"):
            image *= np.float32(min(factor, float(np.finfo(np.float32).max)))


def _bands(height: int, row_paths: int, device: str | None) -> Iterator[tuple[int, int]]:
    paths = BAND_PATHS if device in (None, "cpu") else CUDA_BAND_PATHS
    rows = max(1, paths // row_paths)
    for begin in range(0, height, rows):
        yield begin, min(begin + rows, height)
