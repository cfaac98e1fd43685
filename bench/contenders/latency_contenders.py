"""The contenders of `bench latency`: every backend and lane form, Warp's own query, embreex."""

import functools
import importlib.util
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import wive
from bench.support.scenes import Mesh
from wive.backend import CPU_BACKENDS

Array = NDArray[np.float32]
Call = Callable[[], object]
LaneForm = Literal[1, 8]


@dataclass(frozen=True)
class Contender:
    """A way to find closest hits: `prepare` turns a batch of rays into a call that returns with hits written.

    `prepare` brings the rays to the contender's device; the call does not.
    """

    name: str
    device: str
    prepare: Callable[[Array, Array], Call]


def contenders(
    mesh: Mesh, device: str, lanes: Sequence[LaneForm], threads: int, only: Sequence[str]
) -> Iterator[Contender]:
    """The contenders that can run here, each built over the mesh just before it is measured."""
    makers: dict[str, Callable[[], Contender]] = {}
    for name, backend in wive.backends().items():
        if name in CPU_BACKENDS and backend.usable:
            makers[name] = lambda name=name: _cpu(mesh, name, threads)  # type: ignore[misc]
    if wive.backends()["warp"].usable:
        for form in lanes:
            makers[f"warp L={form}"] = lambda form=form: _warp(mesh, device, form)  # type: ignore[misc]
        from bench.contenders.mesh_query_ray import BUILDERS

        for builder in BUILDERS:
            makers[f"mesh_query_ray {builder}"] = functools.partial(_mesh_query_ray, mesh, device, builder)
    if importlib.util.find_spec("embreex"):
        makers["embreex"] = lambda: _embreex(mesh)
    for name, make in makers.items():
        if not only or name in only:
            yield make()


def _cpu(mesh: Mesh, backend: str, threads: int) -> Contender:
    scene = wive.Scene(mesh.vertices, mesh.faces, backend=backend)

    def prepare(origins: Array, directions: Array) -> Call:
        return lambda: scene.intersect(origins, directions, threads=threads)

    return Contender(backend, "cpu", prepare)


def _warp(mesh: Mesh, device: str, lanes: LaneForm) -> Contender:
    import warp as wp

    scene = wive.Scene(mesh.vertices, mesh.faces, device=device)

    def prepare(origins: Array, directions: Array) -> Call:
        rays = [wp.array(rows, dtype=wp.vec3, device=device) for rows in (origins, directions)]

        def call() -> None:
            scene.intersect(*rays, lanes=lanes)
            wp.synchronize_device(device)

        return call

    return Contender(f"warp L={lanes}", device, prepare)


def _mesh_query_ray(mesh: Mesh, device: str, builder: str) -> Contender:
    import warp as wp

    from bench.contenders.mesh_query_ray import MeshQuery

    query = MeshQuery(mesh, device, builder)

    def prepare(origins: Array, directions: Array) -> Call:
        starts = wp.array(origins, dtype=wp.vec3, device=device)
        ways = wp.array(directions, dtype=wp.vec3, device=device)

        def call() -> None:
            query.launch(starts, ways, *query.outputs(len(origins)))
            wp.synchronize_device(device)

        return call

    return Contender(f"mesh_query_ray {builder}", device, prepare)


def _embreex(mesh: Mesh) -> Contender:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene: Any = EmbreeScene()
    TriangleMesh(scene, mesh.vertices, mesh.faces)

    def prepare(origins: Array, directions: Array) -> Call:
        return lambda: scene.run(origins, directions, query="INTERSECT", output=1)

    return Contender("embreex", "cpu", prepare)
