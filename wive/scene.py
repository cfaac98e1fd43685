"""The scene: a mesh, the tree over it, and the queries users make."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu, arguments
from wive.arrays import NUMPY, host_array
from wive.backend import available_threads, resolve_backend
from wive.crossings import CrossingQueries, LanesOption
from wive.files import PathLike
from wive.hits import Hits, Stats, WrappedHits, stats_of
from wive.meshfile import load_mesh
from wive.rays import check_rays
from wive.storage import Options, read_scene, write_scene

if TYPE_CHECKING:
    from wive.warp_kernels import Tree
    from wive.warp_tracer import WarpTracer


class Scene(CrossingQueries):
    """A triangle mesh that answers ray queries.

    A scene never changes, so several threads may query it at once, and so may processes forked from this one.
    """

    _bvh: _cpu.Bvh
    _warp: "WarpTracer | None" = None

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        backend: str = "auto",
        device: str | None = None,
        accuracy: Literal["fast", "watertight", "exact"] = "watertight",
        nodes: Literal["float32"] = "float32",
    ) -> None:
        """Build the tree.

        Arguments:
            vertices: (v,3) real numbers, used as float32.
            faces: (f,3) integers, three vertices a triangle, counter-clockwise as seen from the side that its
                normal points to. Zero-area triangles keep their number and are never hit.
            backend: "auto" (the fastest CPU backend this machine has) or a name in `wive.backends()`.
            device: where backend "warp" traces, by Warp's names: "cpu", "cuda:0", ...; None is the first CUDA
                device, else "cpu". A device alone implies backend "warp"; CPU backends take none.
            accuracy: "watertight" (rays never slip between triangles that share an edge or vertex), "fast",
                or "exact" (hits, their order, t and uv are those of exact arithmetic, rounded once).
            nodes: "float32".

        C-contiguous float32 vertices and int32 faces are kept, not copied: don't change them afterwards.

        Raises ValueError or TypeError, in one line naming the argument, and the index of a vertex that is NaN
        or infinite or of a face out of range.
        """
        arguments.choice("accuracy", accuracy, ("fast", "watertight", "exact"))
        arguments.choice("nodes", nodes, ("float32",))
        self._options = Options(backend=backend, device=device, accuracy=accuracy, nodes=nodes)
        self._backend, self._device = resolve_backend(backend, device)
        mesh = arguments.mesh(host_array("vertices", vertices), host_array("faces", faces))
        self._vertices, self._faces = map(_read_only, mesh)
        self._bvh = _cpu.Bvh(self._vertices, self._faces, accuracy, threads=available_threads())
        if self._device is not None:
            from wive.warp_tracer import WarpTracer

            self._warp = WarpTracer(self._bvh, self._vertices, self._faces, self._device)

    @classmethod
    def from_file(cls, path: PathLike, **kwargs: Any) -> "Scene":
        """A scene from a mesh file, read by `wive.load_mesh`; keywords are those of `Scene`."""
        return cls(*load_mesh(path), **kwargs)

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
                float32 arrays are not copied, others are converted once. Directions may have any length.
                Warp, torch and DLPack arrays give hits in arrays of their library, on their device, without
                passing through the host; for a Warp scene they must lie on its device and be float32. No call
                waits for the GPU then: with Warp's memory pools on, CUDA graphs can capture it.
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
        work = arguments.work(threads, available_threads(), in_flight, stats)
        counts: Stats | None
        if self._warp is not None:
            hits, counts = self._warp.intersect(rays, chosen, bool(stats))
        else:
            t, prim, uv, table = self._bvh.intersect(self._backend, *rays.numpy(), *work)
            hits, counts = Hits(t, prim, uv, self._vertices, self._faces), stats_of(table, rays.library)
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
        work = arguments.work(threads, available_threads(), in_flight, stats)
        counts: Stats | None
        if self._warp is not None:
            mask, counts = self._warp.occluded(rays, chosen, bool(stats))
        else:
            found, table = self._bvh.occluded(self._backend, *rays.numpy(), *work)
            mask, counts = rays.library.from_numpy(found), stats_of(table, rays.library)
        return mask if counts is None else (mask, counts)

    def save(self, path: PathLike) -> None:
        """Write the scene to a file that `wive.load` reads; the file is whole or absent."""
        write_scene(path, self._vertices, self._faces, self._options)

    @property
    def vertices(self) -> NDArray[np.float32]:
        """(v,3) float32, read-only."""
        return self._vertices

    @property
    def faces(self) -> NDArray[np.int32]:
        """(f,3) int32, read-only."""
        return self._faces

    @property
    def bounds(self) -> NDArray[np.float32]:
        """(2,3) float32 lowest and highest corner of the triangles that can be hit; inf, -inf without any."""
        return self._bvh.bounds

    @property
    def memory(self) -> int:
        """Bytes of the tree: nodes and leaves."""
        return self._bvh.memory

    @property
    def backend(self) -> str:
        """The backend that traces: never "auto"."""
        return self._backend

    @property
    def device(self) -> str | None:
        """The Warp device that traces, such as "cuda:0"; None for CPU backends."""
        return self._device

    @property
    def tree(self) -> "Tree":
        """The tree on the scene's Warp device, for `wive.warp_kernels`; ValueError for CPU backends."""
        if self._warp is None:
            raise ValueError(
                f"tree is for scenes with backend 'warp', this one has {self._backend!r}: "
                "make it with device='cpu' or device='cuda:0'"
            )
        return self._warp.tree

    @property
    def accuracy(self) -> str:
        """ "watertight", "fast" or "exact"."""
        return self._bvh.accuracy

    def __len__(self) -> int:
        """Number of triangles."""
        return len(self._faces)

    def __repr__(self) -> str:
        """Size and options."""
        return f"Scene({len(self)} triangles, backend={self.backend!r}, accuracy={self.accuracy!r})"

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


def _rebuild(vertices: NDArray[np.float32], faces: NDArray[np.int32], options: Options) -> Scene:
    return Scene(vertices, faces, **options)


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    view = array.view(np.ndarray)
    view.flags.writeable = False
    return view
