"""What queries return: hits, and counters of the work behind them."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.arrays import Library
from wive._internal.distant import Moved
from wive._internal.error_bounds import t_error_bounds
from wive._internal.gradients import warn_of_lost_gradients
from wive._internal.host_arrays import host_array
from wive._internal.interpolation import interpolated, vertex_values_of
from wive._internal.known_meshes import OfMesh, mesh_sizes
from wive._internal.precision import FLOAT64, Floats, real_of
from wive._internal.rays import Rays
from wive._internal.sides import cosines_of, meets_front
from wive._internal.spawn import spawn_origins
from wive._internal.wrapping import Wrapping, from_home, keep_wrapped, library_name
from wive.geoms import Geoms, one_geom


class Stats(NamedTuple):
    """What each ray did, three (n,) int32 arrays: inner nodes visited, leaves visited, triangles tested."""

    inner_nodes: NDArray[np.int32]
    leaves: NDArray[np.int32]
    triangles: NDArray[np.int32]


def stats_of(table: NDArray[np.int32], library: Library) -> Stats:
    """The columns of an (n,3) table of steps as arrays of that library."""
    return Stats(*(library.from_numpy(np.ascontiguousarray(column)) for column in table.T))


def surface_points(
    vertices: Floats, faces: NDArray[np.int32], prim: NDArray[np.int32], uv: Floats
) -> NDArray[np.float64]:
    """(h,3) points at uv (h,2) of triangles prim (h,); NaN if prim is -1."""
    return _cpu.surface_points(vertices, faces, np.ascontiguousarray(prim), np.ascontiguousarray(uv))


def surface_normals(
    vertices: Floats, faces: NDArray[np.int32], prim: NDArray[np.int32]
) -> NDArray[np.float64]:
    """(h,3) unit normals of triangles prim (h,), by the right-hand winding; NaN if prim is -1."""
    return _cpu.surface_normals(vertices, faces, np.ascontiguousarray(prim))


class InMeshes(Protocol):
    """Hits in a scene of one mesh or several."""

    vertices: Floats
    faces: NDArray[np.int32]
    _geoms: Geoms | None


def geoms_of(hits: InMeshes) -> Geoms:
    """The meshes of the scene that was hit; hits in a scene of one mesh hold none."""
    return hits._geoms or one_geom(*mesh_sizes(hits))


class OnTriangles:
    """Places on triangles of a mesh: `prim` (n,) and `uv` (n,2)."""

    prim: NDArray[np.int32]
    uv: Floats
    vertices: Floats
    faces: NDArray[np.int32]
    _geoms: Geoms | None = None

    @property
    def geom(self) -> NDArray[np.int32]:
        """(n,) int32, the mesh that was hit, as `Scene.from_meshes` numbers them; -1 on a miss.

        Computed when read; 0 for every hit in a scene of one mesh.
        """
        return geoms_of(self).of(self.prim)

    @property
    def geom_prim(self) -> NDArray[np.int32]:
        """(n,) int32, the triangle that was hit as a row of the faces of its own mesh; -1 on a miss.

        Computed when read; `prim` in a scene of one mesh.
        """
        return geoms_of(self).within(self.prim)

    def points(self) -> NDArray[np.float64]:
        """(n,3) float64 points from the barycentrics; NaN on a miss.

        Computed at each call, in float64: rounding to float32 would move points off triangles that lie far
        from the origin.
        """
        return surface_points(self.vertices, self.faces, self.prim, self.uv)

    def normals(self) -> NDArray[np.float64]:
        """(n,3) float64 unit normals of the triangles, by the right-hand winding; NaN on a miss.

        Computed at each call. The normal is the triangle's, whichever side the ray or point came from.
        """
        return surface_normals(self.vertices, self.faces, self.prim)


class OnSurface(OnTriangles):
    """Places on triangles, or on none: `prim` is -1 there."""

    @property
    def mask(self) -> NDArray[np.bool_]:
        """(n,) bool, true if there is a triangle: the ray hit something, or a point is close to it."""
        return self.prim >= 0

    def interpolate(self, vertex_values: ArrayLike) -> Floats:
        """Values given at the vertices, at the points hit: (1-u-v) a + u b + v c; NaN on a miss.

        Arguments:
            vertex_values: (v,) or (v,k) real numbers, one row per vertex of the scene: colours, temperatures,
                smooth normals. A masked number counts as NaN. Values per triangle need no interpolation:
                `values[hits.prim]`, of no meaning where `mask` is False.

        Returns (n,) or (n,k), computed in float64: float32 if the values are float16 or float32, else
        float64. On a Warp device the values are float32 or float64, or NumPy's, which are copied there.
        Raises ValueError or TypeError that names the argument.

        >>> smooth = hits.interpolate(vertex_normals)
        """
        warn_of_lost_gradients("interpolate", vertex_values=vertex_values)
        values = vertex_values_of(host_array("vertex_values", vertex_values), len(self.vertices))
        return interpolated(values, self.faces, self.prim, self.uv)


class Hits(OnSurface, OfMesh):
    """The closest hit of each of n rays; if these have another leading shape, (n,) below is that shape.

    Arrays are NumPy's if the rays were, else of the library and on the device that the rays came in;
    `vertices` and `faces` are always NumPy's.

    Attributes:
        t: (n,) float32, distance in multiples of the direction's length; inf on a miss.
        prim: (n,) int32, row of `faces` that was hit, also in a scene of several meshes; -1 on a miss.
        uv: (n,2) float32, the hit point is (1-u-v) v0 + u v1 + v v2; NaN on a miss.
        vertices: (v,3) float32 and
        faces: (f,3) int32, the mesh that `prim` refers to.

    t, uv and vertices are float64 for a float64 scene.

    Pickles hold what was computed and the rays, not the mesh. They name it: by the file or the shared memory
    that the scene is in, else by a token that the process of the scene and those forked from it know. It is
    looked up when `points`, `normals` or others first need it; a process that has none raises ValueError
    then, and `with_mesh` gives it one.
    """

    t: Floats
    _rays: Rays | None
    _accuracy: str
    _moved: Moved | None

    def __init__(
        self,
        t: Floats,
        prim: NDArray[np.int32],
        uv: Floats,
        vertices: Floats,
        faces: NDArray[np.int32],
        rays: Rays | None = None,
        accuracy: str = "",
        moved: Moved | None = None,
        geoms: Geoms | None = None,
    ) -> None:
        """Keep the arrays; a scene adds its rays and accuracy, for `error_bound` and `spawn`."""
        # In one step: making hits is a tenth of a query of one ray.
        attributes = {
            "t": t,
            "prim": prim,
            "uv": uv,
            "vertices": vertices,
            "faces": faces,
            "_rays": rays,
            "_accuracy": accuracy,
            "_moved": moved,
            "_geoms": geoms,
        }
        object.__setattr__(self, "__dict__", attributes)

    @property
    def error_bound(self) -> NDArray[np.float64]:
        """(n,) float64 upper bound on |t - t*|, in the unit of t; NaN on a miss.

        t* is the exact distance at which the ray, with vertices and rays in the scene's precision, meets the
        plane of the triangle hit; for float64 rays that start so far away that they are brought near before
        they are rounded, the ray as it was given. The bound is proved for every accuracy, docs/accuracy.md,
        "The error of t". It is inf if double arithmetic can't tell the ray from one in the plane. It comes in
        float64, because what remains after t was rounded to float32 is far below what a float32 of that size
        resolves. For float64 scenes most of the bound is the error that its own computation in double may
        have made: some 25 units in the last place of t if that is well-conditioned.

        Computed at each call, from the arrays that held the rays: it is wrong if you have changed them.
        Raises ValueError if no scene returned these hits.
        """
        if self._rays is None:
            raise ValueError("error_bound needs hits that a scene returned: these were made without rays")
        origins, directions, *_ = self._rays.numpy(real_of(self.vertices.dtype, self._accuracy))
        bounds = t_error_bounds(self.vertices, self.faces, self.prim, self.t, origins, directions)
        if self._moved is None:
            return bounds
        mesh, t = (FLOAT64.array(self.vertices), self.faces), FLOAT64.array(self.t)
        as_given = t_error_bounds(*mesh, self.prim, t, *self._moved.given)
        return np.where(self._moved.steps != 0, as_given, bounds)

    def spawn(self, directions: ArrayLike) -> Floats:
        """(n,3) origins for rays that leave the surface from the points hit; NaN on a miss.

        float32, or float64 for a float64 scene. Each origin lies on the side of its triangle that its
        direction points to, just far enough that a ray from there with tmin = 0 doesn't hit this triangle in
        a scene of the same accuracy and precision; docs/accuracy.md, "Spawned rays", has the proof, and what
        holds for neighbours. In `fast`, meshes must measure between 1e-12 and 1e12. All directions to one
        side have the same origin. Rays from NaN origins miss.

        Arguments:
            directions: (n,3) real numbers, used in the scene's precision, or (3,) for all; of any length. On
                a Warp device, arrays as `Scene.intersect` takes them.

        Raises ValueError or TypeError, in one line naming the argument.

        >>> blocked = scene.occluded(hits.spawn(to_light), to_light, tmax=1)
        """
        if not self._accuracy:
            raise ValueError("spawn needs hits that a scene returned: these were made without an accuracy")
        given = host_array("directions", directions)
        rows = arguments.directions(given, len(self), real_of(self.vertices.dtype, self._accuracy))
        return spawn_origins(self.vertices, self.faces, self.prim, self.uv, rows, self._accuracy)

    @property
    def front(self) -> NDArray[np.bool_]:
        """(n,) bool, whether the ray meets the side that the triangle's normal points to; False on a miss.

        Exact: the sign of normal . direction is that of real arithmetic on the scene's numbers. A ray that
        runs in the triangle's plane meets no front. Computed at each call, from the arrays that held the
        rays. Raises ValueError if no scene returned these hits.
        """
        return meets_front(self.vertices, self.faces, self.prim, self._directions("front"))

    def cosines(self) -> NDArray[np.float64]:
        """(n,) float64 |normal . direction| / |direction|, from 0 to 1 whichever side is hit; NaN on a miss.

        1 is a ray that meets the triangle at a right angle, as for the intensity of a lidar's return. The
        normal is that of `normals`. Computed at each call, from the arrays that held the rays. Raises
        ValueError if no scene returned these hits.
        """
        return cosines_of(self.normals(), self._directions("cosines"))

    def _directions(self, wanted: str) -> Floats:
        if self._rays is None:
            raise ValueError(f"{wanted} needs hits that a scene returned: these were made without rays")
        return self._rays.numpy(real_of(self.vertices.dtype, self._accuracy))[1]

    def __len__(self) -> int:
        """Number of rays."""
        return len(self.t)

    def __repr__(self) -> str:
        """Number of rays and of hits."""
        return f"Hits({len(self)} rays, {np.count_nonzero(self.mask)} hit)"


class WrappedHits(Hits):
    """Hits in the arrays of another library than the backend's; `_home` holds the backend's arrays."""

    _home: Any
    _wrapping: Wrapping

    def __init__(self, home: Any, wrapping: Wrapping) -> None:
        """Wrap t, prim and uv of `home`, a `Hits` or a `WarpHits`; all else is computed when used."""
        keep_wrapped(self, home, wrapping, "t", "prim", "uv")
        vars(self).update(_rays=None, _accuracy="", _moved=None)

    mask = from_home(Hits.mask)
    geom = from_home(Hits.geom)
    geom_prim = from_home(Hits.geom_prim)
    points = from_home(Hits.points)
    normals = from_home(Hits.normals)
    error_bound = from_home(Hits.error_bound)
    front = from_home(Hits.front)
    cosines = from_home(Hits.cosines)
    interpolate = from_home(Hits.interpolate)
    spawn = from_home(Hits.spawn)

    def __len__(self) -> int:
        """Number of rays."""
        return len(self._home)

    def __repr__(self) -> str:
        """Number of rays, and the library of their hits."""
        return f"Hits({len(self)} rays, in arrays of {library_name(self.t)})"
