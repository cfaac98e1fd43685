"""The scene: a mesh and the tree over it; its queries are in `wive._internal.queries`."""

from __future__ import annotations

import html
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive import _cpu
from wive._internal import arguments, mesh_arguments
from wive._internal.cpu_tracer import CpuTracer
from wive._internal.files import PathLike, file_name
from wive._internal.heightfield import heightfield_mesh
from wive._internal.host_arrays import host_array
from wive._internal.known_meshes import know_again, make_known
from wive._internal.mesh_objects import MeshObject, PlacedMeshes, mesh_arrays
from wive._internal.moving_part import move_in_place
from wive._internal.options import (
    AccuracyOption,
    BuildOptions,
    NodesOption,
    QualityOption,
    SceneOptions,
)
from wive._internal.options import threads as checked_threads
from wive._internal.point_queries import PointQueries
from wive._internal.precision import Floats, real_of
from wive._internal.process_lock import PROCESS_LOCK
from wive._internal.progress import ProgressOption, checked_progress, reported
from wive._internal.queries import Queries
from wive._internal.scene_facts import SceneFacts
from wive._internal.several_meshes import Joined, Pair, join, moved_rows, name_the_mesh, refitted_mesh
from wive._internal.storage import (
    FORMAT_VERSION,
    GEOMS,
    Options,
    geom_offsets,
    geoms_of_offsets,
    refuse_newer,
    write_scene,
)
from wive._internal.stored_scenes import save_file, share, source_of
from wive._internal.tracer import Tracer
from wive.backend import resolve_backend
from wive.geoms import Geoms
from wive.meshfile import MeshSource, load_mesh, named_mesh

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Scene(Queries, PointQueries, SceneFacts):
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
        threads: int | None = None,
        progress: ProgressOption = None,
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
                CUDA device, else "cpu". A device alone implies backend "warp"; CPU backends take none. "cpu"
                is Warp's CPU device, which uses one core and is for developing kernels: to trace on CPUs,
                leave `device` out.
            accuracy: "watertight" (rays never slip between triangles that share an edge or vertex), "fast",
                or "exact" (hits, their order, t and uv are those of exact arithmetic, rounded once; vertices
                that float32 can't hold, whatever their dtype, are refused).
            nodes: "float32", or "compressed": the same hits, under two thirds the bytes, for large trees.
            quality: "medium", or "high" for a tree that takes about four times as long to build and gives the
                same hits in fewer steps: a sixth fewer if triangle sizes differ much, none in even meshes.
            threads: how many build the tree, for every backend; None is every core. Scenes don't keep it.
            progress: True shows a bar, if there is tqdm; or a callable that is called as
                progress(done, total) with numbers of triangles: by the calling thread, some ten times a
                second at most, `done` never falling, at last once with done == total. An exception of it
                ends the work and reaches the caller, as Ctrl-C does. On Warp devices queries and refits tell
                the end alone.

        C-contiguous float32 or float64 vertices and int32 faces are kept, not copied: don't change them.

        Raises ValueError or TypeError, in one line naming the argument, and the index of a vertex that is NaN
        or infinite, or that "exact" would have to round, or of a face out of range.
        """
        arguments.choice("accuracy", accuracy, ("fast", "watertight", "exact"))
        arguments.choice("nodes", nodes, ("float32", "compressed"))
        arguments.choice("quality", quality, ("medium", "high"))
        builders = checked_threads(threads)
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
        mesh = mesh_arguments.mesh(*given, accuracy, dtype, rounding)
        points, faces = map(arguments.read_only, mesh)
        bvh = reported(
            checked_progress(progress),
            len(faces),
            "triangle",
            "building",
            lambda: _cpu.Bvh(points, faces, accuracy, nodes=nodes, quality=quality, threads=builders),
        )
        self._take(tracer_of(bvh, faces, found, place, geoms), faces)

    def _take(self, tracer: Tracer, faces: NDArray[np.int32], instead_of: Tracer | None = None) -> None:
        """Trace with this tracer from now on; if one is given, only if it has not been replaced meanwhile."""
        vertices = tracer.bvh.vertices
        source = tracer.bvh.source
        make_known(vertices, faces, None if source is None else source.place)
        with PROCESS_LOCK:
            if instead_of is not None and self._tracer is not instead_of:
                return
            self._real = real_of(vertices.dtype, tracer.bvh.accuracy)
            self._tracer, self._faces = tracer, faces

    @classmethod
    def from_file(
        cls,
        source: MeshSource,
        *,
        dtype: DTypeLike | None = None,
        file_type: str | None = None,
        **kwargs: Unpack[BuildOptions],
    ) -> Scene:
        """A scene from a mesh file, read by `wive.load_mesh`; other keywords are those of `Scene`.

        `dtype` is np.float32 if it is None. Accuracy "exact" is that for the vertices rounded to `dtype`;
        with np.float64 it refuses files that hold finer numbers than float32.

        The path of a file that `Scene.save` wrote is taken as well: keywords that are left out, and `dtype`
        if it is None, are those of the saved scene. The tree in the file is used if the others agree with it,
        else one is built over the mesh in the file.
        """
        if file_type is None and isinstance(source, str | os.PathLike):
            from wive.loading import from_saved, is_saved_file

            if is_saved_file(source):
                return from_saved(cls, source, dtype, {**kwargs})
        mesh = load_mesh(source, np.float32 if dtype is None else dtype, file_type=file_type)
        return cls(*mesh, **kwargs)

    @classmethod
    def from_meshes(
        cls, meshes: Iterable[MeshObject | Pair] | PlacedMeshes, **kwargs: Unpack[SceneOptions]
    ) -> Scene:
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
            return cls(joined, None, **kwargs)
        except ValueError:
            name_the_mesh(joined)
            raise

    @classmethod
    def from_heightfield(
        cls, z: ArrayLike, x: ArrayLike, y: ArrayLike, **kwargs: Unpack[SceneOptions]
    ) -> Scene:
        """A scene over a grid of heights, such as a digital elevation model; keywords are those of `Scene`.

        Each cell between four heights is two triangles that share the diagonal from its vertex [i, j] to
        [i+1, j+1]. Their normals point up.

        Arguments:
            z: (rows, columns) heights. A NaN or masked one is a hole: the cells around it are left out. Mask
                the number that stands for no data.
            x: (columns,) and
            y: (rows,) their coordinates, each ascending or descending, not necessarily in even steps, also
                as rounded to the scene's precision.

        The scene is float64 if one of the three is an array of float64, as survey coordinates need, else
        float32. Vertex i * columns + j is z[i, j]. Triangle `prim` lies in the cell of rows i, i + 1 and
        columns j, j + 1 for i, j = divmod(prim // 2, columns - 1); even ones have vertex [i, j+1], odd ones
        [i+1, j]. Left out cells are counted as well.

        Raises ValueError or TypeError, in one line naming the argument.

        >>> scene = wive.Scene.from_heightfield(elevation, easting, northing)
        """
        mesh = heightfield_mesh(z, x, y, kwargs.get("accuracy", "watertight"), kwargs.get("dtype"))
        return cls(*mesh, **kwargs)

    @classmethod
    def _of_tracer(cls, tracer: Tracer, faces: NDArray[np.int32], options: Options) -> Scene:
        scene = object.__new__(cls)
        scene._options = options
        scene._take(tracer, faces)
        return scene

    def refit(
        self,
        vertices: ArrayLike,
        *,
        geom: int | None = None,
        threads: int | None = None,
        progress: ProgressOption = None,
    ) -> None:
        """Move the vertices: new positions, the same faces.

        The tree keeps its shape and gets new boxes, in a sixth to a third of the time that building takes.
        Hits are those of a new scene, bit for bit (in `fast`, except of rays at edges and vertices); only
        their speed depends on how well the old shape suits the new positions. It suits them well if
        the mesh bends or moves as a whole. If neighbours part, rays take more steps with every
        refit, and a new `Scene` is worth its price. Triangles that lose their area are no longer
        hit; if one that had none gains some, the tree is built anew, and so are compressed trees.

        Queries that run in other threads meanwhile finish on the old positions. A tree that was taken from
        `tree` before, for `wive.warp_kernels`, keeps them: take it again. Of two refits at once the one that
        ends last counts.

        Arguments:
            vertices: (v,3) real numbers, as many as before, used in the scene's precision. A C-contiguous
                array of that dtype is kept, not copied, and may be the scene's own, changed in place; points
                and normals of earlier hits follow it then.
            geom: the number of a mesh of `from_meshes`: `vertices` are its vertices alone, and are copied,
                all others stay. On CPU backends, from the second time on, this takes about that mesh's share
                of a refit of all, if no query runs meanwhile and no copy of the scene uses its tree.
            threads, progress: as for `Scene`.

        Raises ValueError or TypeError as construction does, and leaves the scene as it was.
        """
        count = checked_threads(threads)
        given = host_array("vertices", vertices)

        def refitted() -> Tracer | None:
            if geom is None:
                points = mesh_arguments.moved_vertices(given, len(self.vertices), self._real)
                return self._tracer.refitted(arguments.read_only(points), count)
            i = arguments.integer("geom", geom, 0, len(self.geoms) - 1)
            rows = moved_rows(self.geoms, i, given, self._real)
            if move_in_place(self, i, rows):
                return None
            return refitted_mesh(self._tracer, self._faces, self.geoms, i, rows, count)

        moved = reported(checked_progress(progress), len(self._faces), "triangle", "refitting", refitted)
        if moved is not None:
            self._take(moved, self._faces)

    def save(self, path: PathLike, *, progress: ProgressOption = None) -> None:
        """Write the scene to a file that `wive.load` opens at once; the file is whole or as it was.

        The file holds nodes, leaves, mesh and options, some bytes more than `memory` and the mesh;
        docs/saved_scenes.md has the format. If the name ends in .npz it holds the mesh and the options alone,
        in NumPy's format, and loading builds the tree again. `progress` is as for `Scene`, in bytes, for
        files of trees.

        Raises ValueError if the name is that of a mesh file, such as part.ply, and OSError if the file can't
        be written.
        """
        checked_progress(progress)
        bvh = self._bvh
        if named_mesh(file_name(path)):
            raise ValueError(
                f"path must not end as mesh files do, got {file_name(path)!r}: name a saved scene .wive"
            )
        if file_name(path).lower().endswith(".npz"):
            write_scene(path, bvh.vertices, self._faces, self._tracer.geoms, self._options)
        else:
            save_file(path, bvh, self._faces, self._tracer.geoms, self._options, progress)

    def share(self) -> None:
        """Move the tree and the mesh into shared memory, so that the scene pickles as its name.

        Other processes of this machine that unpickle the scene, or its hits, then map this memory in
        milliseconds. Nothing happens if the scene is shared already, or in a file that `load` opened.

        This process frees the memory when it lets go of the scene, when `refit` replaces the tree, and when
        it ends; if it is killed, Python's resource tracker does. Processes that have unpickled the scene
        before then keep it, and so do hits. Processes forked from this one don't free it.

        Raises MemoryError if there is not enough shared memory; Linux has it in /dev/shm.

        >>> scene.share()
        >>> with ProcessPoolExecutor() as pool:
        ...     hits = list(pool.map(scene.intersect, origins, directions))  # one tree
        """
        while (tracer := self._tracer).bvh.source is None:
            bvh = share(tracer.bvh, self._faces, tracer.geoms, self._options)
            faces = source_of(bvh).faces
            shared = tracer_of(bvh, faces, tracer.backend, tracer.device, tracer.geoms)
            self._take(shared, faces, instead_of=tracer)

    def _repr_html_(self) -> str:
        """What notebooks show: a small picture, if there is Pillow, and the scene's numbers."""
        from wive._internal.pictures.summary import summary

        try:
            return summary(self)
        except Exception:  # notebooks would print a traceback in place of the scene
            return html.escape(repr(self))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle where the tree is stored; else the mesh and the options, of which it is built again."""
        source = self._bvh.source
        if source is not None:
            from wive.loading import reopened

            return reopened, (source.place, self._options["backend"], self._options["device"])
        options: dict[str, Any] = {**self._options}
        if self._tracer.geoms is not None:
            options[GEOMS] = geom_offsets(self._tracer.geoms)
        token = make_known(self.vertices, self._faces, None)
        return _rebuild, (self.vertices, self._faces, options, FORMAT_VERSION), {"_token": token}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Know the mesh by the name that the hits of the pickled scene have."""
        know_again(self.vertices, self._faces, state["_token"])

    def __copy__(self) -> Scene:
        """A scene of the same tree; refitting one doesn't move the other."""
        return self._of_tracer(self._tracer, self._faces, self._options)

    def __deepcopy__(self, memo: dict[int, Any]) -> Scene:
        """A scene over a copy of the mesh; a stored tree, which nobody can change, is shared."""
        if self._bvh.source is not None:
            return self.__copy__()
        rebuild, (vertices, faces, *rest), _ = self.__reduce__()
        scene: Scene = rebuild(vertices.copy(), faces.copy(), *rest)
        return scene

    def _at_rest(self) -> Scene:
        """The scene as it is now, with the same tree, whatever refits come."""
        scene = object.__new__(type(self))
        vars(scene).update(vars(self))
        return scene


def expect_scene(value: object) -> None:
    """Raise TypeError if `value`, given as the argument `scene`, is none."""
    if not isinstance(value, Scene):
        is_name = isinstance(value, (str, bytes, os.PathLike))
        opened = ": wive.Scene.from_file opens meshes and saved scenes" if is_name else ""
        raise TypeError(f"scene must be a wive.Scene, got {type(value).__name__}{opened}")


def tracer_of(
    bvh: _cpu.Bvh, faces: NDArray[np.int32], backend: str, device: str | None, geoms: Geoms | None
) -> Tracer:
    """What traces with the tree, on a backend and a device that can be used."""
    if device is None:
        return CpuTracer(bvh, faces, backend, geoms)
    from wive.warp_kernels.scene.tracer import WarpTracer

    tracer: Tracer = WarpTracer(bvh, faces, device, geoms)
    return tracer


def _rebuild(vertices: Floats, faces: NDArray[np.int32], options: Any, version: int = 1) -> Scene:
    """The scene of a pickle; pickles that name no version are of the first."""
    refuse_newer("pickled scene", version, options)
    offsets = options.pop(GEOMS, None)
    geoms = None if offsets is None else geoms_of_offsets(offsets, len(faces), len(vertices))
    return Scene(Joined(vertices, faces, geoms), **options)
