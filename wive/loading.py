"""Scenes from files that `Scene.save` wrote, and from pickles that say where their tree is."""

from __future__ import annotations

from typing import Any, cast

from numpy.typing import DTypeLike

from wive import _cpu
from wive._internal.files import PathLike, file_name
from wive._internal.lines import one_line
from wive._internal.npzfile import check_input
from wive._internal.options import threads as checked_threads
from wive._internal.precision import real_asked
from wive._internal.progress import ProgressOption, checked_progress
from wive._internal.several_meshes import Joined
from wive._internal.storage import OPEN_MESH, Options, is_saved_scene, read_scene
from wive._internal.stored_scenes import Place, is_stored_file, open_file, source_of
from wive.backend import resolve_backend
from wive.meshfile import named_mesh
from wive.scene import Scene, tracer_of


def load(
    path: PathLike,
    *,
    backend: str | None = None,
    device: str | None = None,
    progress: ProgressOption = None,
) -> Scene:
    """The scene in a file that `Scene.save` wrote, with the options it was made with.

    The file is mapped read-only, and shared by all processes that load it, which takes milliseconds whatever
    its size. The first query, or `refit`, verifies all of it, on all threads. Don't change the file while a
    scene uses it; to replace it by another, as `save` does, is fine. Files that hold the mesh alone (.npz, or
    of wive 0.1) are read, and the tree is built.

    `backend` or `device`, if given, replaces both saved ones: a scene saved with "avx512" or on "cuda:0"
    opens with backend "auto" on a machine that lacks these. `progress` is that of `Scene`, if a tree is
    built.

    Raises OSError if the file can't be read, ValueError if it is not a saved scene, is damaged, cut short or
    of a newer wive, or if its backend or device can't be used here. What only verifying finds is a
    ValueError of the first query, which names the file.
    """
    return _loaded(Scene, path, backend, device, checked_progress(progress))


def is_saved_file(path: PathLike) -> bool:
    """Whether `Scene.save` wrote this file; OSError if it can't be read."""
    if is_stored_file(path):
        return True
    name = check_input(path)
    with open(name, "rb") as file:
        return is_saved_scene(one_line(name), file)


def from_saved(cls: type[Scene], path: PathLike, dtype: DTypeLike | None, given: dict[str, Any]) -> Scene:
    """The saved scene, or one over its mesh if options are given that its tree doesn't have."""
    progress = checked_progress(given.pop("progress", None))
    threads = given.pop("threads", None)
    checked_threads(threads)
    saved = _loaded(cls, path, given.get("backend"), given.get("device"), progress)
    has: dict[str, Any] = {
        "accuracy": saved.accuracy,
        "nodes": saved.nodes,
        "quality": saved._options["quality"],
    }
    is_other = dtype is not None and real_asked(dtype, saved.accuracy).dtype != saved.vertices.dtype
    has |= {name: given[name] for name in ("backend", "device") if name in given}
    if not is_other and all(name in has and has[name] == value for name, value in given.items()):
        return saved
    saved._bvh.verify()
    mesh = Joined(saved.vertices, saved.faces, saved._tracer.geoms)
    return cls(mesh, **{**saved._options, "dtype": dtype, **given}, threads=threads, progress=progress)


def reopened(place: tuple[Any, ...], backend: str, device: str | None) -> Scene:
    """The scene of a pickle that says where its tree is stored."""
    found = Place(*place)
    return _of_tree(Scene, found.open(), one_line(found.name), {"backend": backend, "device": device})


def _loaded(
    cls: type[Scene], path: PathLike, backend: str | None, device: str | None, progress: ProgressOption
) -> Scene:
    replaced = {} if backend is None and device is None else {"backend": backend or "auto", "device": device}
    name = one_line(file_name(path))
    if is_stored_file(path):
        return _of_tree(cls, open_file(path), name, replaced)
    if named_mesh(name) and not is_saved_file(path):
        raise ValueError(f"{name}: not a scene saved by wive, but a mesh by its name: {OPEN_MESH}")
    vertices, faces, geoms, options = read_scene(path)
    chosen = cast(dict[str, Any], {**options, **replaced})
    try:
        return cls(Joined(vertices, faces, geoms), **chosen, progress=progress)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from error


def _of_tree(cls: type[Scene], bvh: _cpu.Bvh, name: str, replaced: dict[str, Any]) -> Scene:
    """A scene of a stored tree; ValueError that starts with `name` if its backend can't be used here."""
    source = source_of(bvh)
    options = Options(**{**source.options, **replaced})  # type: ignore[typeddict-item]
    try:
        found, place = resolve_backend(options["backend"], options["device"])
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from error
    return cls._of_tracer(tracer_of(bvh, source.faces, found, place, source.geoms), source.faces, options)
