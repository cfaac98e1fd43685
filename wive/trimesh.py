"""Ray queries for trimesh: a drop-in for `trimesh.ray.ray_pyembree.RayMeshIntersector`.

>>> mesh.ray = wive.trimesh.RayMeshIntersector(mesh)
>>> mesh.contains(points)

This module does not import trimesh: it uses the mesh that it is given.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from wive import _cpu
from wive._internal.precision import Floats, real_named
from wive.scene import Scene

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

# Directions for `contains_points`, tried until a ray and its opposite agree; the first is trimesh's.
DIRECTIONS = (
    (0.4395064455, 0.617598629942, 0.652231566745),
    (-0.7312847092, 0.2291845177, 0.6424302511),
    (0.1739403627, -0.8852167384, 0.4314573921),
)


class _Placed(NamedTuple):
    """A scene over the mesh moved to the origin and scaled, and the hash of that mesh."""

    mesh_hash: int
    scene: Scene
    origin: Float64
    scale: float


class RayMeshIntersector:
    """Ray queries on a `trimesh.Trimesh`, with the methods of trimesh's own intersectors.

    Coordinates are converted to `dtype` relative to the mesh's centre, directions to unit vectors. The tree
    is built when first needed, and again after the mesh's hash has changed. Can be pickled and copied.
    """

    def __init__(
        self,
        geometry: Any,
        scale_to_box: bool = True,
        *,
        backend: str = "auto",
        device: str | None = None,
        accuracy: Literal["fast", "watertight", "exact"] = "watertight",
        threads: int | None = None,
        dtype: DTypeLike = np.float32,
    ) -> None:
        """Take a mesh to trace.

        Arguments:
            geometry: the `trimesh.Trimesh`.
            scale_to_box: scale the mesh, by a power of two, to a size of about one.
            backend, device, accuracy: as for `wive.Scene`.
            threads: how many each query uses; None is every core. For CPU backends.
            dtype: of the scene's numbers: np.float32, or np.float64 if detail is finer than 1e-7 of the
                mesh's size.

        Raises TypeError if `geometry` is no such mesh. Queries raise what `wive.Scene` and its queries raise.
        """
        missing = [name for name in ("vertices", "faces", "bounds") if not hasattr(geometry, name)]
        if missing:
            raise TypeError(
                f"geometry must be a trimesh.Trimesh, got {type(geometry).__name__} without "
                f"{', '.join(missing)}: make one with trimesh.load(path, force='mesh')"
            )
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._options: dict[str, Any] = {"backend": backend, "device": device, "accuracy": accuracy}
        self._threads = threads
        self._real = real_named(dtype)
        self._placed: _Placed | None = None

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
        ascending ray.
        """
        origins, directions = _rays(ray_origins, ray_directions)
        placed = self._place()
        near, unit = _placed_rays(placed, origins, directions)
        if multiple_hits:
            found = placed.scene.intersect_all(near, unit, threads=self._threads)
            ray = found.ray
            depth = np.arange(len(ray)) - found.offsets[ray]
            if len(ray) and depth.max() < 1 << 16:
                depth = depth.astype(np.uint16)  # NumPy sorts 16-bit integers by radix
            order = np.argsort(depth, kind="stable")
            if max_hits is not None:
                order = order[: np.count_nonzero(depth < max_hits)]
            ray, prim, uv = ray[order], found.prim[order], found.uv[order]
        else:
            first = placed.scene.intersect(near, unit, threads=self._threads)
            (ray,) = np.nonzero(first.mask) if max_hits is None or max_hits > 0 else (np.zeros(0, np.int64),)
            prim, uv = first.prim[ray], first.uv[ray]
        triangles, rays = prim.astype(np.int64), ray.astype(np.int64)
        if not return_locations:
            return triangles, rays
        return triangles, rays, self._locations(placed, (prim, uv, rays), origins, directions)

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
        placed = self._place()
        rays = _placed_rays(placed, *_rays(ray_origins, ray_directions))
        return placed.scene.intersect(*rays, threads=self._threads).prim

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """(n,) bool: whether each ray hits anything."""
        placed = self._place()
        rays = _placed_rays(placed, *_rays(ray_origins, ray_directions))
        return placed.scene.occluded(*rays, threads=self._threads)

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """(n,) bool: whether each point (n,3) lies inside the mesh, which must be closed.

        A point is inside if rays in both directions along a line pass the surface an odd number of times. If
        the two disagree, as they may at an edge, another line is tried. Points on the surface may be inside
        or not.
        """
        places = np.asarray(points, np.float64)
        if places.ndim != 2 or places.shape[1] != 3:
            raise ValueError(f"points must have shape (n, 3), got {places.shape}")
        contained = np.zeros(len(places), np.bool_)
        if self.mesh.bounds is None:
            return contained
        low, high = self.mesh.bounds
        (asked,) = np.nonzero(((places >= low) & (places <= high)).all(axis=1))
        placed = self._place()
        for direction in DIRECTIONS:
            there = self._passes(placed, places[asked], np.array(direction))
            back = self._passes(placed, places[asked], -np.array(direction))
            # A ray that meets nothing proves that the point is outside, whatever the other ray meets.
            free = (there == 0) | (back == 0)
            agreed = there % 2 == back % 2
            contained[asked] = (there % 2 == 1) & ~free
            asked = asked[~agreed & ~free]
            if len(asked) == 0:
                break
        return contained

    def _passes(self, placed: _Placed, points: Float64, direction: Float64) -> NDArray[np.int32]:
        rays = _placed_rays(placed, points, np.broadcast_to(direction, points.shape))
        return placed.scene.count(*rays, threads=self._threads)

    def _place(self) -> _Placed:
        mesh_hash, placed = hash(self.mesh), self._placed
        if placed is None or placed.mesh_hash != mesh_hash:
            vertices, bounds = np.asarray(self.mesh.vertices, np.float64), self.mesh.bounds
            origin, scale = np.zeros(3), 1.0
            if bounds is not None:
                origin = np.mean(bounds, axis=0, dtype=np.float64)
                size = float(np.max(bounds[1] - bounds[0]))
                if self._scale_to_box and 0 < size < np.inf:
                    scale = 2.0 ** -round(np.log2(size))
            placed_vertices = self._real.array((vertices - origin) * scale)
            scene = Scene(placed_vertices, np.asarray(self.mesh.faces), **self._options)
            self._placed = placed = _Placed(mesh_hash, scene, origin, scale)
        return placed

    def _locations(
        self,
        placed: _Placed,
        hits: tuple[NDArray[np.int32], Floats, Int64],
        origins: Float64,
        directions: Float64,
    ) -> Float64:
        """(m,3) points where rays meet the planes of the triangles they hit, in the mesh's own float64."""
        prim, uv, ray = hits
        vertices = np.ascontiguousarray(self.mesh.vertices, np.float64)
        return _cpu.points_on_rays(vertices, placed.scene.faces, prim, uv, ray, origins, directions)

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


def _rays(ray_origins: ArrayLike, ray_directions: ArrayLike) -> tuple[Float64, Float64]:
    """Origins and unit directions, (n,3); NaN if a direction has no length."""
    origins = np.asarray(ray_origins, np.float64)
    directions = np.asarray(ray_directions, np.float64)
    if origins.shape != directions.shape or origins.ndim != 2 or origins.shape[1] != 3:
        raise ValueError(
            "ray_origins and ray_directions must both have shape (n, 3), "
            f"got {origins.shape} and {directions.shape}"
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        lengths = np.sqrt(np.einsum("ij,ij->i", directions, directions))
        return np.ascontiguousarray(origins), directions / lengths[:, None]


def _placed_rays(placed: _Placed, origins: Float64, directions: Float64) -> tuple[Float64, Float64]:
    """The rays in the scene's coordinates."""
    return (origins - placed.origin) * placed.scale, directions
