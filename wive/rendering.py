"""Pictures of scenes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal import options
from wive._internal.picture import Colours, How, Image, Look, Settings, Shading
from wive._internal.pictures.albedo import Albedo, albedo_of
from wive._internal.pictures.daylight import light_of, up_of_frame
from wive._internal.pictures.image_files import write_picture as write_picture
from wive._internal.pictures.image_files import write_png as write_png
from wive._internal.pictures.shades import AmbientOcclusion, Headlight, NormalColours, render_depth
from wive._internal.pictures.surroundings import Sight, reaches_sky, stands_inside
from wive._internal.pictures.viewpoint import default_camera
from wive._internal.progress import ProgressOption, checked_progress, part, reported
from wive.camera import Camera, unit_vector
from wive.scene import Scene, expect_scene
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
    progress: ProgressOption = None,
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
        progress: True shows a progress bar, if there is tqdm; or a callable of (done, total) in rows, as for
            `Scene`.
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
    settings = settings_of(
        shading=shading,
        width=width,
        height=height,
        spp=spp,
        albedo=albedo,
        seed=seed,
        threads=threads,
        **how,
    )
    return render_counted(scene, camera, settings, progress=checked_progress(progress)).image


def settings_of(**given: Any) -> Settings:
    """The settings with these fields, checked."""
    unknown = given.keys() - Settings.__dataclass_fields__.keys()
    if unknown:
        raise TypeError(f"render() got an unexpected keyword argument {min(unknown)!r}")
    return Settings(**given)


class Picture(NamedTuple):
    """A picture, how it was shaded, and how many rays were traced for it."""

    image: Image
    shading: str
    rays: int


def render_counted(
    scene: Scene, camera: Perspective | None, settings: Settings, *, progress: ProgressOption
) -> Picture:
    """The picture that `render` returns."""
    expect_scene(scene)
    with _cpu.DefaultFloats():  # the caller's floating-point environment would round otherwise
        scene = scene._at_rest()
        _cpu.expect_memory(settings.height * settings.width * 3 * np.dtype(np.float32).itemsize)
        plan = planned(scene, camera, settings)
        image = np.zeros(plan.shape, np.float32)
        rays = reported(
            progress,
            settings.height,
            "row",
            "rendering",
            lambda: render_rows(scene, plan, image, 0, settings.height),
        )
        if plan.shading in EXPOSABLE:
            expose(image, exposure_factor(image[:, :, 1], settings.exposure))
        return Picture(image, plan.shading, rays)


class Plan(NamedTuple):
    """All that a picture depends on besides the scene: rows that are rendered apart make one picture."""

    settings: Settings
    camera: Perspective
    albedo: Albedo
    shading: str
    reach: float

    @property
    def frame(self) -> NDArray[np.float64]:
        """(4,3) the camera's eye, and the vectors that span the picture."""
        return self.camera._frame(self.settings.width, self.settings.height)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the picture."""
        channels = () if self.shading == "depth" else (3,)
        return self.settings.height, self.settings.width, *channels


def planned(scene: Scene, camera: Perspective | None, settings: Settings) -> Plan:
    """What the settings mean for a scene that no refit changes meanwhile."""
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
    options.refuse_lacking(scene.backend, scene._tracer.lacks, {"threads": settings.threads})
    albedo = albedo_of(settings.albedo, scene)
    width, height = settings.width, settings.height
    if camera is None:
        camera = default_camera(scene, aspect=width / height, threads=settings.threads)
    shading, reach = _resolved(scene, camera._frame(width, height), settings)
    return Plan(settings, camera, albedo, shading, reach)


def render_rows(scene: Scene, plan: Plan, image: Image, begin: int, end: int) -> int:
    """Render rows [begin, end) into the image of the whole picture; returns how many rays were traced."""
    frame, settings = plan.frame, plan.settings
    if plan.shading == "path":
        look = _look(settings, plan.albedo, frame, plan.camera)
        return _trace_paths(scene, frame.astype(np.float32), image, look, begin, end)
    return _shade(scene, plan, image, begin, end)


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


def _shade(scene: Scene, plan: Plan, image: Image, begin: int, end: int) -> int:
    """Render by the scene's queries."""
    frame, spp, threads = plan.frame, plan.settings.spp, plan.settings.threads
    if plan.shading == "depth":
        return render_depth(image, frame, scene, threads, begin, end)
    kinds = {"normals": NormalColours, "headlight": Headlight}
    seed = plan.settings.seed
    shader = (
        AmbientOcclusion(scene, plan.albedo, seed, threads, plan.reach, spp)
        if plan.shading == "ao"
        else kinds[plan.shading](scene, plan.albedo, seed, threads)
    )
    return shader.render(image, frame, spp, begin, end)


def _look(settings: Settings, albedo: Albedo, frame: NDArray[np.float64], camera: Perspective) -> Look:
    up = up_of_frame(frame) if isinstance(camera, PinholeCamera) else unit_vector("up", camera.up)
    light = light_of(settings.sky, settings.sun, frame, up)
    kind = "gray" if albedo.kind == "none" else albedo.kind
    threads = options.threads(settings.threads)
    return Look(settings.spp, settings.bounces, kind, albedo.colours, light, settings.seed, threads)


def _trace_paths(scene: Scene, frame: Image, image: Image, look: Look, begin: int, end: int) -> int:
    trace = scene._tracer.rows_renderer(frame, image, look)
    rays = 0
    for first, last in _bands(begin, end, image.shape[1] * look.spp, scene.device):
        with part((first - begin) / (end - begin), (last - begin) / (end - begin)):
            rays += trace(first, last)
    return rays


def exposure_factor(green: Image | None, exposure: float | str) -> np.float32:
    """By what the whole picture is multiplied; "auto" looks at its green, which is most of the luminance."""
    if exposure == "auto":
        assert green is not None
        bright = float(np.quantile(green, 0.9))
        factor = EXPOSED / bright if bright > 0 else 1.0
    else:
        factor = 2.0 ** float(exposure)
    return np.float32(min(factor, float(np.finfo(np.float32).max)))


def expose(image: Image, factor: np.float32) -> Image:
    """The picture, multiplied in place."""
    if factor != 1:
        with np.errstate(over="ignore"):
            image *= factor
    return image


def _bands(begin: int, end: int, row_paths: int, device: str | None) -> Iterator[tuple[int, int]]:
    paths = BAND_PATHS if device in (None, "cpu") else CUDA_BAND_PATHS
    rows = max(1, paths // row_paths)
    for first in range(begin, end, rows):
        yield first, min(first + rows, end)
