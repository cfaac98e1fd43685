"""The calls that `bench python` compares, NumPy arrays in and out: wive, embreex, trimesh, Warp, Open3D."""

import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import wive
from bench.support.scenes import Mesh
from bench.support.timing import core_count

Array = NDArray[np.float32]

# The queries, as the table names them.
CLOSEST = "closest: t, prim, uv"
FIRST = "closest: prim alone"
ANY = "any hit"
LOCATION = "closest: point, ray, prim"
ALL = "all hits: point, ray, prim"
SCENE = "wive.Scene"
QUERIES = (CLOSEST, FIRST, ANY, LOCATION, ALL)


@dataclass(frozen=True)
class Caller:
    """One library's call for one query: `call` takes origins and directions, `hits` counts the hits."""

    name: str
    query: str
    call: Callable[[Array, Array], Any]
    hits: Callable[[Any], int]
    method: str = ""  # trimesh's intersector method, which wive.trimesh has under the same name
    options: dict[str, bool] = field(default_factory=dict)
    threads: int | None = None  # None for libraries that can't say, and use one


class Ours:
    """wive's calls for every query and number of threads: of a scene and of the intersector for trimesh."""

    def __init__(self, mesh: Mesh) -> None:
        """Builds the scene of the mesh."""
        self.mesh = mesh
        self.scene = wive.Scene(mesh.vertices, mesh.faces)
        self._drop_ins: dict[int, Any] = {}

    def counterparts(self, rival: Caller, threads: int) -> Iterator[Caller]:
        """The calls that can replace a rival's."""
        yield self.by_scene(rival.query, threads)
        if rival.method:
            bound = getattr(self._drop_in(threads), rival.method)
            call = partial(bound, **rival.options)
            yield Caller("wive.trimesh", rival.query, call, rival.hits)

    def _drop_in(self, threads: int) -> Any:
        if threads not in self._drop_ins:
            adapter: Any = importlib.import_module("wive.trimesh")
            self._drop_ins[threads] = adapter.RayMeshIntersector(_as_trimesh(self.mesh), threads=threads)
        return self._drop_ins[threads]

    def by_scene(self, query: str, threads: int) -> Caller:
        """The call of `wive.Scene` for a query."""
        scene: Any = self.scene

        def intersect(origins: Array, directions: Array) -> Any:
            return scene.intersect(origins, directions, threads=threads)

        def location(origins: Array, directions: Array) -> Any:
            hits = intersect(origins, directions)
            rays = np.flatnonzero(hits.mask)
            return hits.points()[rays], rays, hits.prim[rays]

        def every(origins: Array, directions: Array) -> Any:
            many = scene.intersect_all(origins, directions, threads=threads)
            rays = np.repeat(np.arange(len(origins)), np.diff(many.offsets))
            return origins[rays] + many.t[:, None] * directions[rays], rays, many.prim

        ways: dict[str, tuple[Callable[[Array, Array], Any], Callable[[Any], int]]] = {
            CLOSEST: (intersect, lambda hits: int(np.count_nonzero(hits.prim >= 0))),
            FIRST: (
                lambda origins, directions: intersect(origins, directions).prim,
                lambda prim: int(np.count_nonzero(prim >= 0)),
            ),
            ANY: (
                lambda origins, directions: scene.occluded(origins, directions, threads=threads),
                lambda mask: int(np.count_nonzero(mask)),
            ),
            LOCATION: (location, lambda found: len(found[2])),
            ALL: (every, lambda found: len(found[2])),
        }
        return Caller(SCENE, query, *ways[query])


def others(mesh: Mesh) -> Iterator[Caller]:
    """The callers of every other library that is installed."""
    makers = {"embreex": _embreex, "trimesh": _trimesh, "warp": _warp, "open3d": _open3d}
    for module, make in makers.items():
        if importlib.util.find_spec(module) is not None:
            yield from make(mesh)


def thread_counts() -> list[int]:
    """One thread, and as many as there are cores."""
    return sorted({1, core_count()})


def absent() -> list[str]:
    """The libraries that are not installed."""
    return [
        name for name in ("embreex", "trimesh", "warp", "open3d") if importlib.util.find_spec(name) is None
    ]


def _embreex(mesh: Mesh) -> Iterator[Caller]:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene: Any = EmbreeScene()
    TriangleMesh(scene, mesh.vertices, mesh.faces)
    yield Caller(
        "embreex run(output=1)",
        CLOSEST,
        lambda origins, directions: scene.run(origins, directions, query="INTERSECT", output=1),
        lambda found: int(np.count_nonzero(found["primID"] >= 0)),
    )
    yield Caller(
        "embreex run",
        FIRST,
        lambda origins, directions: scene.run(origins, directions),
        lambda prim: int(np.count_nonzero(prim >= 0)),
    )
    yield Caller(
        'embreex run("OCCLUDED")',
        ANY,
        lambda origins, directions: scene.run(origins, directions, query="OCCLUDED"),
        lambda found: int(np.count_nonzero(found == 0)),  # 0: occluded, -1: free
    )


def _trimesh(mesh: Mesh) -> Iterator[Caller]:
    if importlib.util.find_spec("embreex") is None:
        return
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    intersector: Any = RayMeshIntersector(_as_trimesh(mesh))

    def caller(query: str, method: str, hits: Callable[[Any], int], **options: bool) -> Caller:
        given = ", ".join(f"{name}={value}" for name, value in options.items())
        name = f"trimesh {method}({given})" if given else f"trimesh {method}"
        return Caller(name, query, partial(getattr(intersector, method), **options), hits, method, options)

    yield caller(FIRST, "intersects_first", lambda prim: int(np.count_nonzero(prim >= 0)))
    yield caller(ANY, "intersects_any", lambda mask: int(np.count_nonzero(mask)))
    yield caller(LOCATION, "intersects_location", lambda found: len(found[2]), multiple_hits=False)
    yield caller(ALL, "intersects_location", lambda found: len(found[2]), multiple_hits=True)


def _as_trimesh(mesh: Mesh) -> Any:
    import trimesh

    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def _warp(mesh: Mesh) -> Iterator[Caller]:
    import warp as wp

    from bench.contenders.mesh_query_ray import MeshQuery

    query = MeshQuery(mesh, "cpu")

    def call(origins: Array, directions: Array) -> Any:
        outputs = query.outputs(len(origins))
        starts, ways = (wp.array(rays, dtype=wp.vec3, device="cpu") for rays in (origins, directions))
        query.launch(starts, ways, *outputs)
        return [output.numpy() for output in outputs]

    yield Caller("wp.mesh_query_ray, CPU", CLOSEST, call, lambda found: int(np.count_nonzero(found[1] >= 0)))


def _open3d(mesh: Mesh) -> Iterator[Caller]:
    o3d: Any = importlib.import_module("open3d")
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.vertices), o3d.core.Tensor(mesh.faces.astype(np.uint32)))

    def tensor(origins: Array, directions: Array) -> Any:
        return o3d.core.Tensor(np.concatenate([origins, directions], axis=1))

    def cast(origins: Array, directions: Array, threads: int) -> Any:
        found = scene.cast_rays(tensor(origins, directions), nthreads=threads)
        return [found[name].numpy() for name in ("t_hit", "primitive_ids", "primitive_uvs")]

    def occluded(origins: Array, directions: Array, threads: int) -> Any:
        return scene.test_occlusions(tensor(origins, directions), nthreads=threads).numpy()

    for threads in thread_counts():
        yield Caller(
            "Open3D cast_rays",
            CLOSEST,
            partial(cast, threads=threads),
            lambda found: int(np.count_nonzero(np.isfinite(found[0]))),
            threads=threads,
        )
        yield Caller(
            "Open3D test_occlusions",
            ANY,
            partial(occluded, threads=threads),
            lambda mask: int(np.count_nonzero(mask)),
            threads=threads,
        )
