"""The commands of the command line, given their parsed options."""

import sys
import time
from argparse import Namespace
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.npzfile import check_input
from wive._internal.picture import Settings
from wive._internal.pictures.image_files import check_picture_output, write_picture
from wive._internal.pictures.viewpoint import default_camera
from wive._internal.terrain import terrain_camera, terrain_colours, terrain_mesh
from wive._internal.textures import refuse_part
from wive.backend import Backend, backends
from wive.camera import Camera
from wive.colors import load_colors
from wive.loading import is_saved_file
from wive.meshfile import load_mesh
from wive.rendering import render_counted
from wive.scene import Scene
from wive.streams import check_hits_output, trace

# Sine of an angle: a nearer `up` is along the view.
ALONG_VIEW = 1e-6
# Printers stand parts on the xy plane; glTF's specification has y up.
USUAL_UPS = {
    ".stl": (0.0, 0.0, 1.0),
    ".3mf": (0.0, 0.0, 1.0),
    ".gltf": (0.0, 1.0, 0.0),
    ".glb": (0.0, 1.0, 0.0),
    ".vrm": (0.0, 1.0, 0.0),
}
# Shadings that show no colours of surfaces.
COLOURLESS = "normals", "depth"


def render_picture(options: Namespace) -> None:
    """`wive render`: a picture of a mesh, or of the terrain."""
    output = check_picture_output(options.output, [options.mesh], options.shading)
    if options.mesh:
        refuse_part(check_input(options.mesh), output)
    chosen = {field.name: getattr(options, field.name) for field in fields(Settings)}
    colours = chosen.pop("albedo")
    settings = Settings(**chosen)
    scene = _scene_of(options, options.mesh)[0] if options.mesh else _scene(options, *terrain_mesh())
    if colours != "file":
        settings = replace(settings, albedo=colours)
    elif options.shading not in COLOURLESS:
        albedo = load_colors(options.mesh) if options.mesh else terrain_colours(scene.vertices)
        settings = replace(settings, albedo=albedo)
    camera = _camera(options, scene)
    begin = time.perf_counter()
    picture = render_counted(scene, camera, settings, progress=_shows_bars())
    seconds = time.perf_counter() - begin
    write_picture(output, picture.image, srgb=picture.shading != "normals")
    how = f"{_rate(picture.rays, seconds)}, {_tracer(scene)}, {len(scene):,} triangles"
    print(f"{output}: {picture.shading}, {how}")
    if picture.shading == "path" and settings.sky != "black" and not np.median(picture.image[:, :, 1]) > 0:
        hint = "hardly any path reached the sky, and most of the picture is black: --shading ao shows rooms"
        print(f"wive: {hint}", file=sys.stderr)


def trace_rays(options: Namespace) -> None:
    """`wive trace`: write the closest hits, or all, of a file of rays."""
    output = check_hits_output(options.output, [options.mesh, options.rays])
    check_input(options.rays)
    refuse_part(check_input(options.mesh), output)
    if not options.all and (options.touching or options.max_bytes is not None):
        option = "--touching" if options.touching else "max_bytes"
        raise ValueError(f"{option} is only for all hits: add --all, or leave it out")
    scene, _ = _scene_of(options, options.mesh)
    how: dict[str, Any] = {} if options.threads is None else {"threads": options.threads}
    if options.all:
        how |= {"touching": options.touching, "max_bytes": options.max_bytes}
    traced = trace(
        scene,
        options.rays,
        output,
        query="intersect_all" if options.all else "intersect",
        raw=options.raw,
        columns=options.columns,
        resume=options.resume,
        piece=options.piece,
        progress=_shows_bars(),
        **how,
    )
    if traced.resumed == traced.rays > 0:
        print(f"{output}: complete already, {traced.rays:,} rays, {traced.hits:,} hits")
        return
    resumed = f" after {traced.resumed:,} before" if traced.resumed else ""
    rate = _rate(traced.rays - traced.resumed, traced.seconds)
    print(f"{output}: {rate}{resumed}, {traced.hits:,} hits, {_tracer(scene)}")


def describe_mesh(options: Namespace) -> None:
    """`wive info`: the mesh and the tree over it."""
    scene, seconds = _scene_of(options, options.mesh)
    digits = "g" if scene.precision == "float32" else ".12g"
    low, high = (" ".join(f"{value:{digits}}" for value in corner) for corner in scene.bounds)
    tree = scene._bvh
    node_cost, triangle_cost = tree.sah
    for name, value in (
        ("triangles", f"{len(scene):,}"),
        ("vertices", f"{len(scene.vertices):,}"),
        ("bounds", f"{low} to {high}"),
        ("backend", _tracer(scene)),
        ("accuracy", scene.accuracy),
        ("precision", scene.precision),
        ("nodes", f"{len(tree.nodes):,}"),
        ("form", f"{scene.nodes} nodes"),
        ("depth", f"{tree.depth}"),
        (
            "SAH cost",
            f"{node_cost + triangle_cost:.2f} ({node_cost:.2f} nodes, {triangle_cost:.2f} triangles)",
        ),
        ("memory", f"{scene.memory:,} bytes ({scene.memory / len(scene):.1f} per triangle)"),
        ("build" if scene._bvh.source is None else "load", f"{seconds:.3f} s"),
    ):
        print(f"{name:<10} {value}")


def list_backends(options: Namespace) -> None:
    """`wive backends`: what this machine can run, and on which devices."""
    for name, backend in backends().items():
        print(f"{name:<7} {_usable(backend)}")
        for device, found in backend.devices.items():
            print(f"  {device:<7} {_usable(found)}")


def _shows_bars() -> bool:
    """Whether there is somebody to watch progress."""
    return sys.stderr is not None and sys.stderr.isatty()


def _scene_of(options: Namespace, path: str) -> tuple[Scene, float]:
    """The scene of a mesh file or a saved scene, and the seconds that its tree took."""
    precision = getattr(options, "precision", None)
    if is_saved_file(path):
        begin = time.perf_counter()
        scene = Scene.from_file(path, dtype=precision, progress=_shows_bars(), **_given(options))
        scene._bvh.verify()
    else:
        mesh = load_mesh(path, precision or "float32")
        begin = time.perf_counter()
        scene = _scene(options, *mesh)
    return scene, time.perf_counter() - begin


def _scene(options: Namespace, vertices: NDArray[Any], faces: NDArray[Any]) -> Scene:
    return Scene(vertices, faces, progress=_shows_bars(), **_given(options))


def _given(options: Namespace) -> dict[str, Any]:
    """The options of `Scene` that the user gave."""
    names = ("backend", "device", "accuracy", "nodes", "threads")
    given = {name: getattr(options, name, None) for name in names}
    return {name: value for name, value in given.items() if value is not None}


def _usable(backend: Backend) -> str:
    if not backend.usable:
        return f"not usable: {backend.reason}"
    return f"usable, {backend.form} form" if backend.form else "usable"


def _tracer(scene: Scene) -> str:
    return scene.backend if scene.device is None else f"{scene.backend} on {scene.device}"


def _camera(options: Namespace, scene: Scene) -> Camera:
    """The camera that the options describe; the automatic camera fills in what they leave open."""
    fov = {} if options.fov is None else {"fov": options.fov}
    if options.mesh is None:
        camera = terrain_camera()
    else:
        aspect = options.width / options.height
        up = options.up or _usual_up(options.mesh)
        if options.eye is None and options.target is None:
            camera = default_camera(scene, up, options.fov, aspect, options.threads)
        else:
            camera = Camera.framing(scene.bounds, up, aspect=aspect, **fov)
    given = {name: getattr(options, name) for name in ("eye", "target", "up", "fov")}
    given = {name: value for name, value in given.items() if value is not None}
    if "up" not in given:  # a view along the automatic up, as from above, has the next axis up
        with np.errstate(all="ignore"):  # cameras of no sense are refused below
            view = np.subtract(given.get("target", camera.target), given.get("eye", camera.eye))
            aside = np.cross(view, np.asarray(camera.up))
            if np.max(abs(aside)) <= ALONG_VIEW * np.max(abs(view)):
                given["up"] = np.roll(camera.up, -1)
    return replace(camera, **given)


def _usual_up(mesh: str) -> tuple[float, float, float] | None:
    """What is up in files of a format by convention; None if programs differ."""
    return next((up for ending, up in USUAL_UPS.items() if mesh.lower().endswith(ending)), None)


def _rate(rays: int, seconds: float) -> str:
    return f"{rays:,} rays in {seconds:.2f} s, {rays / max(seconds, 1e-9) / 1e6:.2f} Mray/s"
