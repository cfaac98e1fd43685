"""The scene: a mesh, the tree over it, and the queries users make."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.arrays import NUMPY, host_array
from wive._internal.crossings import CrossingQueries, LanesOption
from wive._internal.files import PathLike
from wive._internal.precision import FLOAT32, Floats, real_of
from wive._internal.properties import SceneProperties
from wive._internal.rays import check_rays
from wive._internal.refit import Refittable
from wive._internal.storage import Options, read_scene, write_scene
from wive.backend import resolve_backend
from wive.hits import Hits, Stats, WrappedHits, stats_of
from wive.meshfile import load_mesh

if TYPE_CHECKING:
    from wive.warp_kernels.scene.tracer import WarpTracer


class Scene(Refittable, CrossingQueries, SceneProperties):
    """A triangle mesh that answers ray queries.

    Several threads may query it at once, and so may processes forked from this one. Only `refit` changes it,
    all at once: a query sees the old positions or the new ones.
    """

    _warp: "WarpTracer | None" = None

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        backend: str = "auto",
        device: str | None = None,
        accuracy: Literal["fast", "watertight", "exact"] = "watertight",
        nodes: Literal["float32", "compressed"] = "float32",
        quality: Literal["medium", "high"] = "medium",
    ) -> None:
        """Build the tree.

        Arguments:
            vertices: (v,3) real numbers. An array of float64 makes a float64 scene: vertices, rays, t and uv
                are float64, for coordinates such as surveys'. All else, lists too, is used as float32.
            faces: (f,3) integers, three vertices a triangle, counter-clockwise as seen from the side that its
                normal points to. Zero-area triangles keep their number and are never hit.
            backend: "auto" (the fastest CPU backend this machine has) or a name in `wive.backends()`.
            device: where backend "warp" traces, by Warp's names: "cpu", "cuda:0", ...; None is the first CUDA
                device, else "cpu". A device alone implies backend "warp"; CPU backends take none.
            accuracy: "watertight" (rays never slip between triangles that share an edge or vertex), "fast",
                or "exact" (hits, their order, t and uv are those of exact arithmetic, rounded once; float32
                numbers only, whatever their dtype).
            nodes: "float32", or "compressed": the same hits, under two thirds the bytes, for large trees.
            quality: "medium", or "high" for a tree that takes about four times as long to build and gives
                the same hits in fewer steps: a sixth fewer where sizes differ much, none in even meshes.

        C-contiguous float32 or float64 vertices and int32 faces are kept, not copied: don't change them.

        Raises ValueError or TypeError, in one line naming the argument, and the index of a vertex that is NaN
        or infinite, or that "exact" would have to round, or of a face out of range.
        """
        arguments.choice("accuracy", accuracy, ("fast", "watertight", "exact"))
        arguments.choice("nodes", nodes, ("float32", "compressed"))
        arguments.choice("quality", quality, ("medium", "high"))
        self._options = Options(
            backend=backend, device=device, accuracy=accuracy, nodes=nodes, quality=quality
        )
        self._backend, self._device = resolve_backend(backend, device)
        mesh = arguments.mesh(host_array("vertices", vertices), host_array("faces", faces), accuracy)
        vertices, self._faces = map(arguments.read_only, mesh)
        self._real = real_of(vertices)
        self._bvh = _cpu.Bvh(vertices, self._faces, accuracy, nodes=nodes, quality=quality)
        if self._device is not None:
            from wive.warp_kernels.scene.tracer import WarpTracer

            self._warp = WarpTracer(self._bvh, vertices, self._faces, self._device)

    @classmethod
    def from_file(cls, path: PathLike, *, dtype: DTypeLike = np.float32, **kwargs: Any) -> "Scene":
        """A scene from a mesh file, read by `wive.load_mesh` in that dtype; keywords are those of `Scene`."""
        return cls(*load_mesh(path, dtype), **kwargs)

    @overload
    def intersect(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: Literal[False] = False,
    ) -> Hits: ...
    @overload
    def intersect(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: Literal[True],
    ) -> tuple[Hits, Stats]: ...
    def intersect(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: bool = False,
    ) -> Hits | tuple[Hits, Stats]:
        """The closest hit of each ray with tmin <= t <= tmax.

        Arguments:
            origins, directions: (n,3) real numbers; one of shape (3,) is shared by all rays. C-contiguous
                arrays of the scene's dtype are not copied, others are converted once. Directions may have any
                length. Warp, torch and DLPack arrays give hits in arrays of their library, on their device,
                without passing through the host; for a Warp scene they must lie on its device and have its
                dtype. No call waits for the GPU then: with Warp's memory pools, CUDA graphs can capture it.
            tmin, tmax: a number, or (n,) one a ray, in multiples of the direction's length.
            threads: how many to use; None is every core. For CPU backends.
            in_flight: rays interleaved per thread; None leaves it to wive, 1 is plain single-ray traversal.
                For CPU backends.
            lanes: for backend "warp": 8, a thread owns a ray (throughput), 1, eight threads do (latency), or
                "auto", chosen by device and number of rays.
            stats: return `(hits, stats)`, with what each ray visited.

        Results depend on none of `threads`, `in_flight` and `lanes`, nor on how rays are split into batches.
        A ray misses whose origin is NaN or infinite, whose direction is NaN, infinite or zero, or whose tmin
        is above its tmax.

        Raises ValueError or TypeError, in one line naming the argument.
        """
        rays = check_rays(origins, directions, tmin, tmax, self._backend, self._device)
        chosen = arguments.lanes(lanes, self._warp is not None)
        work = arguments.work(threads, in_flight, stats)
        counts: Stats | None
        if self._warp is not None:
            hits, counts = self._warp.intersect(rays, chosen, bool(stats))
        else:
            bvh = self._bvh
            t, prim, uv, table = bvh.intersect(self._backend, *rays.numpy(self._real), *work)
            hits = Hits(t, prim, uv, bvh.vertices, self._faces, rays, self._options["accuracy"])
            counts = stats_of(table, rays.library)
            if rays.library is not NUMPY:
                hits = WrappedHits(hits, rays.library.from_numpy)
        return hits if counts is None else (hits, counts)

    @overload
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: Literal[False] = False,
    ) -> NDArray[np.bool_]: ...
    @overload
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: Literal[True],
    ) -> tuple[NDArray[np.bool_], Stats]: ...
    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike = 0.0,
        tmax: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        in_flight: int | None = None,
        lanes: LanesOption = "auto",
        stats: bool = False,
    ) -> NDArray[np.bool_] | tuple[NDArray[np.bool_], Stats]:
        """(n,) bool: whether each ray hits anything with tmin <= t <= tmax; arguments as for `intersect`."""
        rays = check_rays(origins, directions, tmin, tmax, self._backend, self._device)
        chosen = arguments.lanes(lanes, self._warp is not None)
        work = arguments.work(threads, in_flight, stats)
        counts: Stats | None
        if self._warp is not None:
            mask, counts = self._warp.occluded(rays, chosen, bool(stats))
        else:
            found, table = self._bvh.occluded(self._backend, *rays.numpy(self._real), *work)
            mask, counts = rays.library.from_numpy(found), stats_of(table, rays.library)
        return mask if counts is None else (mask, counts)

    def save(self, path: PathLike) -> None:
        """Write the scene to a file that `wive.load` reads; the file is whole or absent."""
        write_scene(path, self._vertices, self._faces, self._options)

    def __repr__(self) -> str:
        """Size and options."""
        shown = f"{len(self)} triangles, backend={self.backend!r}, accuracy={self.accuracy!r}"
        return f"Scene({shown})" if self._real is FLOAT32 else f"Scene({shown}, precision='float64')"

    def __reduce__(self) -> tuple[Callable[..., "Scene"], tuple[Any, ...]]:
        """Pickle the mesh and the options; the tree is rebuilt where they are loaded."""
        return _rebuild, (self._vertices, self._faces, self._options)


def load(path: PathLike, *, backend: str | None = None, device: str | None = None) -> Scene:
    """The scene in a file that `Scene.save` wrote, with the options it was made with.

    `backend` or `device`, where given, replace both saved ones: a scene saved with "avx512" or on "cuda:0"
    opens with backend "auto" where these are missing.

    Raises OSError where the file can't be read, ValueError where it is not a saved scene or its backend or
    device can't be used here.
    """
    vertices, faces, options = read_scene(path)
    if backend is not None or device is not None:
        options["backend"], options["device"] = backend or "auto", device
    try:
        return _rebuild(vertices, faces, options)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from error


def _rebuild(vertices: Floats, faces: NDArray[np.int32], options: Options) -> Scene:
    return Scene(vertices, faces, **options)
