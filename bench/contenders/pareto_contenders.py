"""The contenders of `bench pareto`: closest hits of a batch on one core, in several accuracies."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import BenchError
from wive import _cpu
from wive._internal.precision import Floats, real_named

Array = NDArray[np.float32]
Hits = tuple[Floats, NDArray[np.int32]]  # t and prim; prim -1 on a miss
Trace = Callable[[Array, Array], Hits]


class Options(NamedTuple):
    """Options of one of wive's trees."""

    accuracy: Literal["fast", "watertight", "exact"]
    nodes: Literal["float32", "compressed"] = "float32"
    precision: Literal["float32", "float64"] = "float32"


WIVE = {
    "fast": Options("fast"),
    "watertight": Options("watertight"),
    "compressed": Options("watertight", nodes="compressed"),
    "exact": Options("exact"),
    "float64": Options("watertight", precision="float64"),
}
EMBREE = {"embree fast": False, "embree robust": True}
CONTENDERS = (*WIVE, *EMBREE, "mesh_query_ray")

ZERO, INFINITE = np.zeros(1, np.float32), np.full(1, np.inf, np.float32)


@dataclass(frozen=True)
class Contender:
    """A way to find closest hits; `trace_single` traces ray by ray, and is None without that choice."""

    name: str
    trace: Trace
    trace_single: Trace | None = None
    release: Callable[[], None] = lambda: None


def contenders(vertices: Array, faces: NDArray[np.int32]) -> tuple[list[Contender], list[str]]:
    """The contenders that run here, built over the mesh, and a line per other contender that says why not."""
    kernel = _best_kernel()
    found = wive_contenders(vertices, faces)
    missing = []
    makers: dict[str, Callable[[], Contender]] = {
        name: lambda name=name: _embree(name, kernel, vertices, faces)  # type: ignore[misc]
        for name in EMBREE
    }
    makers["mesh_query_ray"] = lambda: _mesh_query_ray(vertices, faces)
    for name, make in makers.items():
        try:
            found.append(make())
        except (BenchError, ImportError, OSError) as problem:
            missing.append(f"{name}: {problem}")
    return found, missing


def wive_contenders(vertices: Array, faces: NDArray[np.int32]) -> list[Contender]:
    """wive's contenders, `fast` first."""
    return [_wive(name, _best_kernel(), vertices, faces) for name in WIVE]


def exact_prims(
    vertices: Array, faces: NDArray[np.int32], origins: Array, directions: Array
) -> NDArray[np.int32]:
    """(n,) right triangles, by accuracy "exact" of the scalar kernel, which tests compare with rationals."""
    bvh = _cpu.Bvh(vertices, faces, "exact")
    prim = bvh.intersect("scalar", origins, directions, ZERO, INFINITE)[1]
    if (prim < 0).any():
        raise BenchError("a ray from inside the sphere misses it: the mesh is not closed")
    return prim


def _best_kernel() -> str:
    return next(name for name, reason in _cpu.kernels().items() if not reason and "." not in name)


def _wive(name: str, kernel: str, vertices: Array, faces: NDArray[np.int32]) -> Contender:
    options = WIVE[name]
    real = real_named(options.precision)
    bvh = _cpu.Bvh(real.array(vertices), faces, options.accuracy, nodes=options.nodes)
    zero, infinite = real.limits.values()
    held: dict[int, Floats] = {}  # rays converted to this precision, as a user's would be

    def ready(rays: Array) -> Floats:
        if id(rays) not in held:
            held[id(rays)] = real.array(rays)
        return held[id(rays)]

    def tracing(in_flight: int) -> Trace:
        def trace(origins: Array, directions: Array) -> Hits:
            o, d = ready(origins), ready(directions)
            return bvh.intersect(kernel, o, d, zero, infinite, threads=1, in_flight=in_flight)[:2]

        return trace

    return Contender(name, tracing(0), tracing(1))


def _embree(name: str, kernel: str, vertices: Array, faces: NDArray[np.int32]) -> Contender:
    from bench.contenders.embree_race import Contender as Race
    from bench.contenders.native_embree import EmbreeMesh

    mesh = EmbreeMesh(vertices, faces, isa=Race(kernel).isa, robust=EMBREE[name])
    mesh.commit()
    return Contender(name, lambda o, d: mesh.intersect(o, d, ZERO, INFINITE)[:2], release=mesh.release)


def _mesh_query_ray(vertices: Array, faces: NDArray[np.int32]) -> Contender:
    import warp as wp

    from bench.contenders.mesh_query_ray import MeshQuery
    from bench.support.scenes import TERRAIN_CAMERA, Mesh

    query = MeshQuery(Mesh("sphere", vertices, faces, TERRAIN_CAMERA), "cpu")
    held: dict[int, Any] = {}

    def trace(origins: Array, directions: Array) -> Hits:
        rays = held.setdefault(
            id(origins), [wp.array(rows, dtype=wp.vec3, device="cpu") for rows in (origins, directions)]
        )
        t, prim, uv = query.outputs(len(origins))
        query.launch(rays[0], rays[1], t, prim, uv)
        return t.numpy(), prim.numpy()

    return Contender("mesh_query_ray", trace)
