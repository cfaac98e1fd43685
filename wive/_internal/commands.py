"""The commands of the command line, given their parsed options."""

import time
from argparse import Namespace
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.arguments import max_bytes as checked_max_bytes
from wive._internal.arguments import rays as checked_rays
from wive._internal.arguments import refuse_lacking
from wive._internal.arguments import threads as checked_threads
from wive._internal.files import atomic_write, check_output
from wive._internal.npz_writer import write_npz
from wive._internal.npzfile import Npz, check_input, open_npy_or_npz
from wive._internal.picture import Settings
from wive._internal.pictures.image_files import check_picture_output, write_picture
from wive._internal.pictures.viewpoint import default_camera
from wive._internal.precision import FLOAT64, Floats, Real, real_named
from wive._internal.progress import progress_bar
from wive._internal.terrain import terrain_camera, terrain_colours, terrain_mesh
from wive._internal.textures import refuse_part
from wive.all_hits import AllHits
from wive.backend import Backend, backends
from wive.camera import Camera
from wive.colors import load_colors
from wive.hits import Hits
from wive.loading import is_saved_file
from wive.meshfile import load_mesh
from wive.rendering import render_counted
from wive.scene import Scene

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
# Rays per step of the progress bar.
BATCH_RAYS = 500_000


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
    picture = render_counted(scene, camera, settings, progress=True)
    seconds = time.perf_counter() - begin
    write_picture(output, picture.image, srgb=picture.shading != "normals")
    how = f"{_rate(picture.rays, seconds)}, {_tracer(scene)}, {len(scene):,} triangles"
    print(f"{output}: {picture.shading}, {how}")


def trace_rays(options: Namespace) -> None:
    """`wive trace`: write the closest hits, or all, of a file of rays to an npz file."""
    output = check_output(options.output, ".npz", [options.mesh, options.rays])
    check_input(options.rays)
    refuse_part(check_input(options.mesh), output)
    scene, _ = _scene_of(options, options.mesh)
    refuse_lacking(scene.backend, scene._tracer.lacks, {"threads": options.threads})
    origins, directions, tmin, tmax = _read_rays(
        options.rays, real_named(scene.precision), scene.accuracy == "exact"
    )
    count = len(origins)
    if not options.all and (options.touching or options.max_bytes is not None):
        option = "--touching" if options.touching else "max_bytes"
        raise ValueError(f"{option} is only for all hits: add --all, or leave it out")
    checked_threads(options.threads)  # before there is a progress bar
    checked_max_bytes(options.max_bytes)
    query: Callable[..., Hits | AllHits] = scene.intersect
    if options.all:
        query = partial(scene.intersect_all, touching=options.touching, max_bytes=options.max_bytes)
    found: list[Hits | AllHits] = []
    begin = time.perf_counter()
    with progress_bar(count, "ray", "tracing") as advance:
        for first in range(0, max(count, 1), BATCH_RAYS):
            batch = slice(first, first + BATCH_RAYS)
            hits = query(
                origins[batch],
                directions[batch],
                tmin[batch] if len(tmin) == count else tmin[0],
                tmax[batch] if len(tmax) == count else tmax[0],
                threads=options.threads,
            )
            found.append(hits)
            advance(len(hits))
    seconds = time.perf_counter() - begin
    arrays = {name: [getattr(hits, name) for hits in found] for name in ("t", "prim", "uv")}
    if options.all:
        counts = [np.diff(hits.offsets) for hits in found if isinstance(hits, AllHits)]
        arrays["offsets"] = [np.zeros(1, np.int64), np.cumsum(np.concatenate(counts))]
    with atomic_write(output) as file:
        write_npz(file, arrays)
    number = sum(np.count_nonzero(prim >= 0) for prim in arrays["prim"])
    print(f"{output}: {_rate(count, seconds)}, {number:,} hits, {_tracer(scene)}")


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


def _scene_of(options: Namespace, path: str) -> tuple[Scene, float]:
    """The scene of a mesh file or a saved scene, and the seconds that its tree took."""
    precision = getattr(options, "precision", None)
    if is_saved_file(path):
        begin = time.perf_counter()
        scene = Scene.from_file(path, dtype=precision, **_given(options))
        scene._bvh.verify()
    else:
        mesh = load_mesh(path, precision or "float32")
        begin = time.perf_counter()
        scene = _scene(options, *mesh)
    return scene, time.perf_counter() - begin


def _scene(options: Namespace, vertices: NDArray[Any], faces: NDArray[Any]) -> Scene:
    return Scene(vertices, faces, **_given(options))


def _given(options: Namespace) -> dict[str, Any]:
    """The options of `Scene` that the user gave."""
    names = ("backend", "device", "accuracy", "nodes")
    given = {name: getattr(options, name) for name in names}
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


def _read_rays(name: str, real: Real, exact: bool) -> tuple[Floats, ...]:
    """Origins, directions, tmin and tmax, checked; for accuracy "exact" rounded to `real`'s dtype."""
    expected = "a file of rays, (n,6) or (n,8) in an .npy or `origins` and `directions` in an .npz"
    with open_npy_or_npz(name, expected) as loaded:
        if isinstance(loaded, Npz):
            if not {"origins", "directions"} <= loaded.keys():
                raise ValueError(f"{name}: not {expected}: found arrays {loaded.listed()}")
            limits = [loaded.get("tmin", 0.0), loaded.get("tmax", np.inf)]
            columns = [loaded["origins"], loaded["directions"], *limits]
        elif loaded.ndim != 2 or loaded.shape[1] not in (6, 8):
            raise ValueError(f"{name}: not {expected}: found shape {loaded.shape}")
        else:
            limits = [loaded[:, 6], loaded[:, 7]] if loaded.shape[1] == 8 else [0.0, np.inf]
            columns = [loaded[:, :3], loaded[:, 3:6], *limits]
    try:
        origins, directions, tmin, tmax = columns
        if not exact and not np.asarray(origins).dtype == np.asarray(directions).dtype == np.float32:
            real = FLOAT64  # a float32 scene brings rays from far away near before it rounds them
        return checked_rays(origins, directions, tmin, tmax, real)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from error


def _rate(rays: int, seconds: float) -> str:
    return f"{rays:,} rays in {seconds:.2f} s, {rays / max(seconds, 1e-9) / 1e6:.2f} Mray/s"
