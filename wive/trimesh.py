"""Ray queries for trimesh: for all meshes at once, or for one, by the methods of trimesh's own intersectors.

>>> wive.trimesh.install()  # every mesh of trimesh now uses wive
>>> mesh.contains(points)
>>> mesh.ray.intersects_location(origins, directions)

Only `install` and `installed` import trimesh.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive._internal import arguments
from wive._internal.inside import closedness, contains, passes_of
from wive._internal.mesh_rays import MeshRays, mesh_class, rays_of, set_rays
from wive._internal.options import AccuracyOption, NodesOption, QualityOption, TreeOptions, refuse_lacking
from wive._internal.options import threads as checked_threads
from wive._internal.placed_mesh import Float64, Found, Int64, PlacedMesh
from wive._internal.precision import FLOAT64, Floats, real_asked
from wive.scene import Scene

if TYPE_CHECKING:
    from typing_extensions import Unpack

LEAST_SQUARED = 1e-280  # shorter vectors lose digits when they are squared


class RayMeshIntersector:
    """Ray queries on a `trimesh.Trimesh`, with the methods of trimesh's own intersectors.

    Coordinates are converted to `dtype` relative to the mesh's centre, directions to unit vectors. Origins
    far away are first moved along their rays to where the mesh is near, in float64. The tree is built when
    first needed, and again after the mesh's hash has changed; making an intersector costs nothing, and the
    mesh may get its data later. Triangles with a corner that is NaN or infinite are never hit. Can be
    pickled and copied.
    """

    def __init__(
        self,
        geometry: Any,
        scale_to_box: bool = True,
        *,
        backend: str = "auto",
        device: str | None = None,
        accuracy: AccuracyOption = "watertight",
        nodes: NodesOption = "float32",
        quality: QualityOption = "medium",
        threads: int | None = None,
        dtype: DTypeLike = np.float32,
    ) -> None:
        """Take a mesh to trace.

        Arguments:
            geometry: the `trimesh.Trimesh`.
            scale_to_box: scale the mesh, by a power of two, to a size of about one.
            backend, device, accuracy, nodes, quality: as for `wive.Scene`.
            threads: how many building and each query use; None is every core. For CPU backends.
            dtype: of the scene's numbers: np.float32, or np.float64 if detail is finer than 1e-7 of the
                mesh's size, but not with accuracy "exact".

        Raises TypeError if `geometry` is no such mesh, ValueError for a bad `dtype`. Queries raise what
        `wive.Scene` and its queries raise.
        """
        # A primitive makes its vertices when they are asked for: its class says that it has some.
        has = type(geometry), getattr(geometry, "__dict__", ())
        missing = [
            name
            for name in ("vertices", "faces", "bounds")
            if isinstance(geometry, type) or not (hasattr(has[0], name) or name in has[1])
        ]
        if missing:
            raise TypeError(
                f"geometry must be a trimesh.Trimesh, got {type(geometry).__name__} without "
                f"{', '.join(missing)}: make one with trimesh.load(path, force='mesh')"
            )
        self._real = real_asked(dtype, accuracy)
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._options: dict[str, Any] = {
            "backend": backend, "device": device, "accuracy": accuracy, "nodes": nodes, "quality": quality
        }  # fmt: skip
        self._threads = threads
        self._placed: tuple[int, PlacedMesh] | None = None

    @property
    def scene(self) -> Scene:
        """The `wive.Scene` over the mesh as it is now, in the units that rays are traced in."""
        return self._place().scene

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> tuple[Int64, Int64] | tuple[Int64, Int64, Float64]:
        """Which triangles each ray hits.

        Arguments:
            ray_origins, ray_directions: (n,3) real numbers.
            multiple_hits: every hit along a ray, or the first only.
            max_hits: the most hits per ray; None is all there are. (trimesh stops at 100.)
            return_locations: whether to return the points hit.

        Returns (m,) int64 rows of `mesh.faces`, (m,) int64 rays, and (m,3) float64 points if
        `return_locations`. As in trimesh, all first hits precede all second ones, and so on, each by
        ascending ray; and one place is one hit: of triangles that coincide there, the first in `mesh.faces`.
        """
        origins, directions = _rays(ray_origins, ray_directions)
        most = None if max_hits is None else arguments.integer("max_hits", max_hits, 0)
        placed = self._place()
        origins = placed.near(origins, directions)
        if multiple_hits:
            found = self._hit_places(placed, origins, directions, most)
        else:
            first = placed.scene.intersect(*placed.rays(origins, directions), threads=self._threads)
            (ray,) = np.nonzero(first.mask & (most != 0))
            found = Found(ray, first.prim[ray], first.uv[ray])
        triangles, rays = found.prim.astype(np.int64), found.ray.astype(np.int64)
        if not return_locations:
            return triangles, rays
        return triangles, rays, placed.points(found, origins, directions)

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[Float64, Int64, Int64]:
        """Where rays hit: (m,3) float64 points, (m,) int64 rays and (m,) int64 rows of `mesh.faces`.

        Arguments and order are those of `intersects_id`.
        """
        triangles, rays, *points = self.intersects_id(
            ray_origins, ray_directions, multiple_hits, return_locations=True
        )
        return points[0], rays, triangles

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.int32]:
        """(n,) int32 row of `mesh.faces` that each ray hits first, -1 if it hits nothing."""
        placed, rays = self._placed_rays(ray_origins, ray_directions)
        return placed.scene.intersect(*rays, threads=self._threads).prim

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """(n,) bool: whether each ray hits anything."""
        placed, rays = self._placed_rays(ray_origins, ray_directions)
        return placed.scene.occluded(*rays, threads=self._threads)

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """(n,) bool: whether each point (n,3) lies inside the mesh, which must be closed.

        A point is inside if rays in both directions along a line pass the surface an odd number of times. If
        the two disagree, another line is tried. Faces may be stored twice, turned or not, as in two-sided
        exports. Points on the surface may be inside or not.
        """
        places = _rows("points", points)
        placed = self._place()
        if placed.closedness is None:
            placed.closedness = closedness(placed, self._threads)
        closed, by_place = placed.closedness
        return contains(placed.bounds, places, passes_of(placed, by_place, self._threads), closed)

    def closest_point(self, points: ArrayLike) -> tuple[Float64, Float64, Int64]:
        """The closest point of the mesh to each point (n,3), as `trimesh.proximity.closest_point` returns it.

        Returns (n,3) float64 points, (n,) float64 distances and (n,) int64 rows of `mesh.faces`: computed in
        float64 for the triangle that is closest in the scene's precision. A point that is NaN or infinite
        has NaN, inf and -1.
        """
        places = _rows("points", points)
        return self._place().closest_points(places, self._threads)

    def _hit_places(
        self, placed: PlacedMesh, origins: Float64, directions: Float64, most: int | None
    ) -> Found:
        """One hit per place: all first ones, then all second ones, and so on."""
        found, again = placed.every_hit(origins, directions, self._threads)
        if again is not None:
            found = found.at(~again)
        ray = found.ray
        counts = np.bincount(ray, minlength=len(origins))
        depth = np.arange(len(ray)) - (np.cumsum(counts) - counts)[ray]
        if len(ray) and depth.max() < 1 << 16:
            depth = depth.astype(np.uint16)  # NumPy sorts 16-bit integers by radix
        order = np.argsort(depth, kind="stable")
        return found.at(order if most is None else order[: np.count_nonzero(depth < most)])

    def _placed_rays(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> tuple[PlacedMesh, tuple[Floats, Floats]]:
        origins, directions = _rays(ray_origins, ray_directions)
        placed = self._place()
        return placed, placed.rays(placed.near(origins, directions), directions)

    def _place(self) -> PlacedMesh:
        mesh_hash = hash(self.mesh)
        kept = self._placed
        if kept is None or kept[0] != mesh_hash:
            options = {**self._options, "threads": self._threads}
            kept = mesh_hash, PlacedMesh(self.mesh, self._scale_to_box, self._real, options)
            self._placed = kept
        return kept[1]

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the tree, which is built again."""
        return {**self.__dict__, "_placed": None}

    def __copy__(self) -> RayMeshIntersector:
        """Another intersector on the same mesh."""
        kept = {**self._options, "threads": self._threads, "dtype": self._real.dtype}
        return RayMeshIntersector(self.mesh, self._scale_to_box, **kept)

    def __deepcopy__(self, memo: dict[int, Any]) -> RayMeshIntersector:
        """Another intersector on the same mesh, as trimesh's own do."""
        return self.__copy__()


class IntersectorOptions(TreeOptions, total=False):
    """The options of `RayMeshIntersector`; see there."""

    scale_to_box: bool
    dtype: DTypeLike


def install(**options: Unpack[IntersectorOptions]) -> None:
    """Use wive for rays, `contains` and closest points of every trimesh mesh in this process.

    What trimesh computes with these uses it: `mesh.nearest`, signed distance, thickness and reach.

    Also of meshes that exist already, and of every mesh to come: copies, submeshes, sums, primitives, loaded
    and unpickled ones. Whether embreex is installed makes no difference. `mesh.ray` is then a
    `RayMeshIntersector`, made when it is first read. An intersector that is assigned to `mesh.ray` afterwards
    is used instead, and so are those of other classes that were assigned before.

    Arguments:
        options: those of `RayMeshIntersector`: backend, device, accuracy, nodes, quality, threads, dtype and
            scale_to_box. Installing again replaces all of them.

    Raises ImportError if trimesh is not installed, and what `RayMeshIntersector` and its queries raise for a
    bad option; nothing changes then.
    """
    kind = mesh_class()
    current = rays_of(kind)
    if current is None or current.options != options:
        probe = RayMeshIntersector(_NoMesh(), **options).scene
        checked_threads(options.get("threads"))
        refuse_lacking(probe.backend, probe._tracer.lacks, {"threads": options.get("threads")})
        set_rays(kind, MeshRays(RayMeshIntersector, {**options}))


def uninstall() -> None:
    """Give every mesh the intersector back that trimesh made for it; nothing if wive is not installed."""
    set_rays(mesh_class(), None)


@contextmanager
def installed(**options: Unpack[IntersectorOptions]) -> Iterator[None]:
    """A block in which wive is installed; when it ends, what was installed before it is again.

    >>> with wive.trimesh.installed(dtype=np.float64):
    ...     inside = mesh.contains(points)

    Blocks may be nested. Raises what `install` raises.
    """
    kind = mesh_class()
    before = rays_of(kind)
    install(**options)
    try:
        yield
    finally:
        set_rays(kind, before)


class _NoMesh:
    """A mesh without triangles, for trying options."""

    vertices, faces, bounds = np.zeros((0, 3)), np.zeros((0, 3), np.int32), None


def _rays(ray_origins: ArrayLike, ray_directions: ArrayLike) -> tuple[Float64, Float64]:
    """Origins and unit directions, (n,3); NaN if a direction has no length."""
    origins, directions = _rows("ray_origins", ray_origins), _rows("ray_directions", ray_directions)
    if origins.shape != directions.shape:
        raise ValueError(
            "ray_origins and ray_directions must both have shape (n, 3), "
            f"got {origins.shape} and {directions.shape}"
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        squared = np.einsum("ij,ij->i", directions, directions)
        if len(squared) and not LEAST_SQUARED <= squared.min() <= squared.max() < np.inf:
            # Squares of very long or short vectors are no numbers: these are scaled by a component first.
            odd = ~((squared >= LEAST_SQUARED) & (squared < np.inf))
            directions = directions.copy()
            directions[odd] /= np.abs(directions[odd]).max(axis=1, keepdims=True)
            squared[odd] = np.einsum("ij,ij->i", directions[odd], directions[odd])
        return origins, directions / np.sqrt(squared)[:, None]


def _rows(name: str, value: ArrayLike) -> Float64:
    """An (n,3) argument in float64, C-contiguous; masked numbers are NaN."""
    return arguments.vectors(name, value, FLOAT64, may_be_one=False).astype(np.float64, copy=False)
