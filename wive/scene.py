"""The scene: a mesh and the tree over it; its queries are in `wive._internal.queries`."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.arguments import AccuracyOption, NodesOption, QualityOption
from wive._internal.cpu_tracer import CpuTracer
from wive._internal.files import PathLike, file_name
from wive._internal.heightfield import heightfield_mesh
from wive._internal.host_arrays import host_array
from wive._internal.lines import one_line
from wive._internal.mesh_objects import MeshObject, PlacedMeshes, mesh_arrays
from wive._internal.point_queries import PointQueries
from wive._internal.precision import Floats, Precision, real_of
from wive._internal.queries import Queries
from wive._internal.several_meshes import Joined, Pair, join, name_the_mesh, refitted_mesh
from wive._internal.storage import (
    FORMAT_VERSION,
    GEOMS,
    Options,
    geom_offsets,
    geoms_of_offsets,
    read_scene,
    refuse_newer,
    write_scene,
)
from wive._internal.tracer import Tracer
from wive.backend import resolve_backend
from wive.geoms import Geoms, one_geom
from wive.meshfile import MeshSource, load_mesh

if TYPE_CHECKING:
    from wive.warp_kernels import Tree


class Scene(Queries, PointQueries):
    """A triangle mesh that answers queries of rays and points.

    Several threads may query it at once, and so may processes forked from this one. Only `refit` changes it,
    all at once: a query sees the old positions or the new ones.
    """

    def __init__(
        self,
        vertices: ArrayLike | MeshObject,
        faces: ArrayLike | None = None,
        *,
        dtype: DTypeLike | None = None,
        backend: str = "auto",
        device: str | None = None,
        accuracy: AccuracyOption = "watertight",
        nodes: NodesOption = "float32",
        quality: QualityOption = "medium",
    ) -> None:
        """Build the tree.

        Arguments:
            vertices: (v,3) real numbers; or, without faces, a mesh object: of trimesh, PyVista or Open3D, or
                any that has vertices and faces, which are copied. Vertices that no face uses may be NaN.
            faces: (f,3) integers, three vertices per triangle, counter-clockwise as seen from the side that
                its normal points to. Zero-area triangles keep their number and are never hit.
            dtype: np.float32 or np.float64, the scene's precision: that of vertices, rays, t and uv. If it is
                None, an array of float64 makes a float64 scene, for coordinates such as surveys', and all
                else, lists included, a float32 scene. Meshes of trimesh and Open3D hold float64.
            backend: "auto" (the fastest CPU backend this machine has) or a name in `wive.backends()`.
            device: the device of backend "warp", by Warp's names: "cpu", "cuda:0", ...; None is the first
                CUDA device, else "cpu". A device alone implies backend "warp"; CPU backends take none.
            accuracy: "watertight" (rays never slip between triangles that share an edge or vertex), "fast",
                or "exact" (hits, their order, t and uv are those of exact arithmetic, rounded once; vertices
                that float32 can't hold, whatever their dtype, are refused).
            nodes: "float32", or "compressed": the same hits, under two thirds the bytes, for large trees.
            quality: "medium", or "high" for a tree that takes about four times as long to build and gives the
                same hits in fewer steps: a sixth fewer if triangle sizes differ much, none in even meshes.

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
        found, place = resolve_backend(backend, device)
        rounding, geoms = "", None
        if isinstance(vertices, Joined):
            vertices, faces, geoms = vertices
        elif faces is None:
            rounding, (vertices, faces) = "dtype=np.float32", mesh_arrays(vertices)
        given = host_array("vertices", vertices), host_array("faces", faces)
        mesh = arguments.mesh(*given, accuracy, dtype, rounding)
        points, self._faces = map(arguments.read_only, mesh)
        self._real = real_of(points.dtype, accuracy)
        bvh = _cpu.Bvh(points, self._faces, accuracy, nodes=nodes, quality=quality)
        self._tracer = _tracer(bvh, self._faces, found, place, geoms)

    @classmethod
    def from_file(
        cls,
        source: MeshSource,
        *,
        dtype: DTypeLike = np.float32,
        file_type: str | None = None,
        **kwargs: Any,
    ) -> Scene:
        """A scene from a mesh file, read by `wive.load_mesh`; other keywords are those of `Scene`.

        Accuracy "exact" is that for the vertices rounded to `dtype`; with np.float64 it refuses files that
        hold finer numbers than float32.
        """
        return cls(*load_mesh(source, dtype, file_type=file_type), **kwargs)

    @classmethod
    def from_meshes(cls, meshes: Iterable[MeshObject | Pair] | PlacedMeshes, **kwargs: Any) -> Scene:
        """One scene, with one tree, over several meshes; keywords are those of `Scene`.

        Arguments:
            meshes: a list whose items are (vertices, faces) or mesh objects, as `Scene` takes them; or a
                `trimesh.Scene`, whose mesh i is node i of `scene.graph.nodes_geometry`, placed by its
                transform in float64. All are copied. Meshes without triangles count.

        Meshes are numbered from 0 in this order, and so are their triangles, one mesh after another:
        `hits.prim` is the row of `scene.faces`, as in every scene, `hits.geom` the mesh, and
        `hits.geom_prim` the row of the mesh's own faces. `geoms` has where each mesh begins.

        The scene is float64 if the vertices of one mesh are an array of float64, else float32; `dtype`
        decides if it is given.

        Raises ValueError or TypeError, in one line naming the mesh by its number, such as "meshes[2]".

        >>> scene = wive.Scene.from_meshes([(ground, ground_faces), trimesh.load_mesh("car.ply")])
        """
        joined = join(meshes, kwargs.get("dtype"), kwargs.get("accuracy", "watertight"))
        try:
            return cls(joined, **kwargs)
        except ValueError:
            name_the_mesh(joined)
            raise

    @classmethod
    def from_heightfield(cls, z: ArrayLike, x: ArrayLike, y: ArrayLike, **kwargs: Any) -> Scene:
        """A scene over a grid of heights, such as a digital elevation model; keywords are those of `Scene`.

        Each cell between four heights is two triangles that share the diagonal from its vertex [i, j] to
        [i+1, j+1]. Their normals point up.

        Arguments:
            z: (rows, columns) heights. A NaN or masked one is a hole: the cells around it are left out. Mask
                the number that stands for no data.
            x: (columns,) and
            y: (rows,) their coordinates, each ascending or descending, not necessarily in even steps.

        The scene is float64 if one of the three is an array of float64, as survey coordinates need, else
        float32. Vertex i * columns + j is z[i, j]. Triangle `prim` lies in the cell of rows i, i + 1 and
        columns j, j + 1 for i, j = divmod(prim // 2, columns - 1); even ones have vertex [i, j+1], odd ones
        [i+1, j]. Left out cells count, too.

        Raises ValueError or TypeError, in one line naming the argument.

        >>> scene = wive.Scene.from_heightfield(elevation, easting, northing)
        """
        return cls(*heightfield_mesh(z, x, y, kwargs.get("accuracy", "watertight")), **kwargs)

    def refit(self, vertices: ArrayLike, *, geom: int | None = None) -> None:
        """Move the vertices: new positions, the same faces.

        The tree keeps its shape and gets new boxes, in a sixth of the time that building takes. Hits are
        those of a new scene, bit for bit; only their speed depends on how well the old shape suits the new
        positions. It suits them well if the mesh bends or moves as a whole. If neighbours part, rays take
        more steps with every refit, and a new `Scene` is worth its price. Triangles that lose their area are
        no longer hit; if one that had none gains some, the tree is built anew, and so are compressed trees.

        Queries that run in other threads meanwhile finish on the old positions. A tree that was taken from
        `tree` before, for `wive.warp_kernels`, keeps them: take it again. Of two refits at once the one that
        ends last counts.

        Arguments:
            vertices: (v,3) real numbers, as many as before, used in the scene's precision. A C-contiguous
                array of that dtype is kept, not copied, and may be the scene's own, changed in place; points
                and normals of earlier hits follow it then.
            geom: the number of a mesh of `from_meshes`: `vertices` are its vertices alone, and are copied,
                all others stay. This takes the time of a refit of all.

        Raises ValueError or TypeError as construction does, and leaves the scene as it was.
        """
        given, tracer = host_array("vertices", vertices), self._tracer
        if geom is not None:
            self._tracer = refitted_mesh(tracer, self._faces, self.geoms, geom, given, self._real)
            return
        points = arguments.moved_vertices(given, len(self.vertices), self._real)
        self._tracer = tracer.refitted(arguments.read_only(points))

    def save(self, path: PathLike) -> None:
        """Write the scene to a file that `wive.load` reads; the file is whole or absent."""
        write_scene(path, self.vertices, self._faces, self._tracer.geoms, self._options)

    @property
    def vertices(self) -> Floats:
        """(v,3) float32 or float64 as `precision` says, read-only."""
        return self._bvh.vertices

    @property
    def faces(self) -> NDArray[np.int32]:
        """(f,3) int32, read-only."""
        return self._faces

    @property
    def geoms(self) -> Geoms:
        """The meshes of `from_meshes`: the first row of each in `faces` and `vertices`; else one mesh."""
        return self._tracer.geoms or one_geom(len(self._faces), len(self.vertices))

    @property
    def bounds(self) -> Floats:
        """(2,3) lowest and highest corner of the triangles that can be hit; inf, -inf if there are none.

        float32 or float64 as `precision` says.
        """
        return self._bvh.bounds

    @property
    def memory(self) -> int:
        """Bytes of the tree: nodes and leaves."""
        return self._bvh.memory

    @property
    def backend(self) -> str:
        """The backend that traces: never "auto"."""
        return self._tracer.backend

    @property
    def device(self) -> str | None:
        """The Warp device that traces, such as "cuda:0"; None for CPU backends."""
        return self._tracer.device

    @property
    def tree(self) -> Tree:
        """The tree on the scene's Warp device, for `wive.warp_kernels`; ValueError for CPU backends."""
        return self._tracer.tree

    @property
    def accuracy(self) -> str:
        """ "watertight", "fast" or "exact"."""
        return self._bvh.accuracy

    @property
    def precision(self) -> Precision:
        """ "float32" or "float64": the dtype of vertices, rays, bounds, t and uv."""
        return self._real.name

    @property
    def nodes(self) -> str:
        """ "float32" or "compressed"."""
        return self._bvh.node_form

    def __len__(self) -> int:
        """Number of triangles."""
        return len(self._faces)

    def __repr__(self) -> str:
        """Size and options."""
        options = f"backend={self.backend!r}, accuracy={self.accuracy!r}, precision={self.precision!r}"
        geoms = self._tracer.geoms
        several = "" if geoms is None else f" in {len(geoms)} meshes"
        return f"Scene({len(self)} triangles{several}, {options})"

    def _repr_html_(self) -> str:
        """What notebooks show: a small picture, if there is Pillow, and the scene's numbers."""
        from wive._internal.pictures.summary import summary

        try:
            return summary(self)
        except Exception:  # notebooks would print a traceback in place of the scene
            return html.escape(repr(self))

    def __reduce__(self) -> tuple[Callable[..., Scene], tuple[Any, ...]]:
        """Pickle the mesh and the options; unpickling builds the tree again."""
        options: dict[str, Any] = {**self._options}
        if self._tracer.geoms is not None:
            options[GEOMS] = geom_offsets(self._tracer.geoms)
        return _rebuild, (self.vertices, self._faces, options, FORMAT_VERSION)

    def _at_rest(self) -> Scene:
        """The scene as it is now, with the same tree, whatever refits come."""
        scene = object.__new__(type(self))
        vars(scene).update(vars(self))
        return scene

    @property
    def _bvh(self) -> _cpu.Bvh:
        return self._tracer.bvh


def _tracer(
    bvh: _cpu.Bvh, faces: NDArray[np.int32], backend: str, device: str | None, geoms: Geoms | None
) -> Tracer:
    if device is None:
        return CpuTracer(bvh, faces, backend, geoms)
    from wive.warp_kernels.scene.tracer import WarpTracer

    tracer: Tracer = WarpTracer(bvh, faces, device, geoms)
    return tracer


def load(path: PathLike, *, backend: str | None = None, device: str | None = None) -> Scene:
    """The scene in a file that `Scene.save` wrote, with the options it was made with.

    `backend` or `device`, if given, replaces both saved ones: a scene saved with "avx512" or on "cuda:0"
    opens with backend "auto" on a machine that lacks these.

    Raises OSError if the file can't be read, ValueError if it is not a saved scene or its backend or device
    can't be used here.
    """
    vertices, faces, geoms, options = read_scene(path)
    if backend is not None or device is not None:
        options["backend"], options["device"] = backend or "auto", device
    try:
        return Scene(Joined(vertices, faces, geoms), **options)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{one_line(file_name(path))}: {error}") from error


def _rebuild(vertices: Floats, faces: NDArray[np.int32], options: Any, version: int = 1) -> Scene:
    """The scene of a pickle; pickles that name no version are of the first."""
    refuse_newer("pickled scene", version, options)
    offsets = options.pop(GEOMS, None)
    geoms = None if offsets is None else geoms_of_offsets(offsets, len(faces), len(vertices))
    return Scene(Joined(vertices, faces, geoms), **options)
