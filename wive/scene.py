"""The scene: a mesh, the tree over it, and the queries users make."""

from collections.abc import Callable
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu, arguments
from wive.backend import available_threads, resolve_backend
from wive.files import PathLike
from wive.hits import Hits, Stats
from wive.meshfile import load_mesh
from wive.storage import Options, read_scene, write_scene


class Scene:
    """A triangle mesh that answers ray queries.

    A scene never changes, so several threads may query it at once, and so may processes forked from this one.
    """

    _bvh: _cpu.Bvh

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        backend: str = "auto",
        device: str | None = None,
        accuracy: Literal["fast", "watertight"] = "watertight",
        nodes: Literal["float32"] = "float32",
    ) -> None:
        """Build the tree.

        Arguments:
            vertices: (v,3) real numbers, used as float32.
            faces: (f,3) integers, three vertices a triangle, counter-clockwise as seen from the side that its
                normal points to. Zero-area triangles keep their number and are never hit.
            backend: "auto" (the fastest this machine has) or a name in `wive.backends()`.
            device: must be None: CPU backends have no devices.
            accuracy: "watertight" (rays never slip between triangles that share an edge or vertex) or "fast".
            nodes: "float32".

        C-contiguous float32 vertices and int32 faces are kept, not copied: don't change them afterwards.

        Raises ValueError or TypeError, in one line naming the argument, and the index of a vertex that is NaN
        or infinite or of a face out of range.
        """
        arguments.choice("accuracy", accuracy, ("fast", "watertight"))
        arguments.choice("nodes", nodes, ("float32",))
        if device is not None:
            raise ValueError(
                f"device must be None in this version of wive: CPU backends have none, got {device!r}"
            )
        self._options = Options(backend=backend, accuracy=accuracy, nodes=nodes)
        self._backend = resolve_backend(backend)
        self._vertices, self._faces = map(_read_only, arguments.mesh(vertices, faces))
        self._bvh = _cpu.Bvh(self._vertices, self._faces, accuracy, threads=available_threads())

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
        stats: bool = False,
    ) -> Hits | tuple[Hits, Stats]:
        """The closest hit of each ray with tmin <= t <= tmax.

        Arguments:
            origins, directions: (n,3) real numbers; one of shape (3,) is shared by all rays. C-contiguous
                float32 arrays are not copied, others are converted once. Directions may have any length.
            tmin, tmax: a number, or (n,) one a ray, in multiples of the direction's length.
            threads: how many to use; None is every core.
            in_flight: rays interleaved per thread; None leaves it to wive, 1 is plain single-ray traversal.
            stats: return `(hits, stats)`, with what each ray visited.

        Results depend on neither `threads` nor `in_flight` nor on how rays are split into batches. A ray with
        a NaN or infinite origin, with a NaN, infinite or zero direction, or with tmin > tmax misses.
        """
        t, prim, uv, counts = self._query(
            self._bvh.intersect, origins, directions, tmin, tmax, threads, in_flight, stats
        )
        hits = Hits(t, prim, uv, self._vertices, self._faces)
        return hits if counts is None else (hits, Stats(*counts.T))

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
        stats: bool = False,
    ) -> NDArray[np.bool_] | tuple[NDArray[np.bool_], Stats]:
        """(n,) bool: whether each ray hits anything with tmin <= t <= tmax; arguments as for `intersect`."""
        mask, counts = self._query(
            self._bvh.occluded, origins, directions, tmin, tmax, threads, in_flight, stats
        )
        return mask if counts is None else (mask, Stats(*counts.T))

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
    def accuracy(self) -> str:
        """ "watertight" or "fast"."""
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

    def _query(
        self,
        query: Callable[..., tuple[Any, ...]],
        origins: ArrayLike,
        directions: ArrayLike,
        tmin: ArrayLike,
        tmax: ArrayLike,
        threads: int | None,
        in_flight: int | None,
        stats: bool,
    ) -> tuple[Any, ...]:
        return query(
            self._backend,
            *arguments.rays(origins, directions, tmin, tmax),
            threads=arguments.threads(threads, available_threads()),
            in_flight=arguments.in_flight(in_flight),
            stats=bool(stats),
        )


def load(path: PathLike, *, backend: str | None = None) -> Scene:
    """The scene in a file that `Scene.save` wrote, with the options it was made with.

    `backend` replaces the saved one: one saved with "avx512" opens with "auto" where that is missing.

    Raises OSError where the file can't be read, ValueError where it is not a saved scene or its backend can't
    run here.
    """
    vertices, faces, options = read_scene(path)
    if backend is not None:
        options["backend"] = backend
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
