"""What queries return: hits, and counters of the work behind them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.arrays import Library, host_array
from wive._internal.error_bounds import t_error_bounds
from wive._internal.precision import Floats, real_of
from wive._internal.rays import Rays
from wive._internal.spawn import spawn_origins


class Stats(NamedTuple):
    """What each ray did, three (n,) int32 arrays: inner nodes visited, leaves visited, triangles tested."""

    inner_nodes: NDArray[np.int32]
    leaves: NDArray[np.int32]
    triangles: NDArray[np.int32]


def stats_of(table: NDArray[np.int32] | None, library: Library) -> Stats | None:
    """The columns of an (n,3) table of steps as arrays of that library."""
    if table is None:
        return None
    return Stats(*(library.from_numpy(np.ascontiguousarray(column)) for column in table.T))


def surface_points(
    vertices: Floats, faces: NDArray[np.int32], prim: NDArray[np.int32], uv: Floats
) -> NDArray[np.float64]:
    """(h,3) points at uv (h,2) of triangles prim (h,); NaN where prim is -1."""
    return _cpu.surface_points(vertices, faces, np.ascontiguousarray(prim), np.ascontiguousarray(uv))


def surface_normals(
    vertices: Floats, faces: NDArray[np.int32], prim: NDArray[np.int32]
) -> NDArray[np.float64]:
    """(h,3) unit normals of triangles prim (h,), by the right-hand winding; NaN where prim is -1."""
    return _cpu.surface_normals(vertices, faces, np.ascontiguousarray(prim))


@dataclass(frozen=True, eq=False, repr=False)
class Hits:
    """The closest hit of each of n rays.

    Arrays are NumPy's where the rays were, else of the library and on the device that the rays came in;
    `vertices` and `faces` are always NumPy's.

    Attributes:
        t: (n,) float32, distance in multiples of the direction's length; inf on a miss.
        prim: (n,) int32, row of `faces` that was hit; -1 on a miss.
        uv: (n,2) float32, the hit point is (1-u-v) v0 + u v1 + v v2; NaN on a miss.
        vertices: (v,3) float32 and
        faces: (f,3) int32, the mesh that `prim` refers to.

    t, uv and vertices are float64 for a float64 scene.
    """

    t: Floats
    prim: NDArray[np.int32]
    uv: Floats
    vertices: Floats
    faces: NDArray[np.int32]
    # Only kept for what is asked later: class variables to the dataclass, which would make fields of them.
    _rays: ClassVar[Rays | None]
    _accuracy: ClassVar[str]

    def __init__(
        self,
        t: Floats,
        prim: NDArray[np.int32],
        uv: Floats,
        vertices: Floats,
        faces: NDArray[np.int32],
        rays: Rays | None = None,
        accuracy: str = "",
    ) -> None:
        """Keep them; as a frozen dataclass would, in a third of the time."""
        self.__dict__.update(
            t=t, prim=prim, uv=uv, vertices=vertices, faces=faces, _rays=rays, _accuracy=accuracy
        )

    @property
    def mask(self) -> NDArray[np.bool_]:
        """(n,) bool, true where the ray hit something."""
        return self.prim >= 0

    def points(self) -> NDArray[np.float64]:
        """(n,3) float64 hit points from the barycentrics; NaN on a miss.

        Computed at each call, in float64: rounding to float32 would move points off triangles that lie far
        from the origin.
        """
        return surface_points(self.vertices, self.faces, self.prim, self.uv)

    def normals(self) -> NDArray[np.float64]:
        """(n,3) float64 unit normals of the triangles hit, by the right-hand winding; NaN on a miss.

        Computed at each call. The normal is the triangle's, whichever side the ray came from.
        """
        return surface_normals(self.vertices, self.faces, self.prim)

    @property
    def error_bound(self) -> NDArray[np.float64]:
        """(n,) float64: t is at most so far from where the ray meets the plane of the triangle hit.

        That is in exact arithmetic on rays and vertices in the scene's precision, in the unit of t; proved
        for every accuracy, docs/accuracy.md, "The error of t". inf where double can't tell the ray from one
        in the plane, NaN on a miss. In float64, because what remains after t was rounded to float32 is far
        below what a float32 of that size resolves. For float64 scenes most of it is the error that judging
        in double may have made: some 25 units in the last place of t where that is well-conditioned.

        Computed at each call, from the arrays that held the rays: it is wrong if you have changed them.
        """
        if self._rays is None:
            raise ValueError("error_bound needs hits that a scene returned: these were made without rays")
        origins, directions, *_ = self._rays.numpy(real_of(self.vertices))
        return t_error_bounds(self.vertices, self.faces, self.prim, self.t, origins, directions)

    def spawn(self, directions: ArrayLike) -> Floats:
        """(n,3) origins for rays that leave the surface from the points hit; NaN on a miss.

        float32, or float64 for a float64 scene. Each lies on the side of its triangle that its direction
        points to, just far enough that a ray from there with tmin = 0 doesn't hit this triangle in a scene of
        the same accuracy and precision; docs/accuracy.md, "Spawned rays", has the proof, and what holds for
        neighbours. All directions to one side have the same origin. Rays from the NaN of a miss miss.

        Arguments:
            directions: (n,3) real numbers, used in the scene's precision, or (3,) for all; of any length. On
                a Warp device, as `Scene.intersect` takes them.

        Raises ValueError or TypeError, in one line naming the argument.

        >>> blocked = scene.occluded(hits.spawn(to_light), to_light, tmax=1)
        """
        if not self._accuracy:
            raise ValueError("spawn needs hits that a scene returned: these were made without an accuracy")
        given = host_array("directions", directions)
        rows = arguments.directions(given, len(self), real_of(self.vertices))
        return spawn_origins(self.vertices, self.faces, self.prim, self.uv, rows, self._accuracy)

    def __len__(self) -> int:
        """Number of rays."""
        return len(self.t)

    def __repr__(self) -> str:
        """Number of rays and of hits."""
        return f"Hits({len(self)} rays, {np.count_nonzero(self.mask)} hit)"


class WrappedHits(Hits):
    """Hits in the arrays of another library: what `wrap` makes of those that they were computed in."""

    _home: Any
    _wrap: Callable[[Any], Any]

    def __init__(self, home: Any, wrap: Callable[[Any], Any]) -> None:
        """Wrap t, prim and uv of `home`, a `Hits` or a `WarpHits`; the rest when asked for."""
        super().__init__(wrap(home.t), wrap(home.prim), wrap(home.uv), home.vertices, home.faces)
        object.__setattr__(self, "_home", home)
        object.__setattr__(self, "_wrap", wrap)

    @property
    def mask(self) -> Any:
        """(n,) bool, true where the ray hit something."""
        return self._wrap(self._home.mask)

    def points(self) -> Any:
        """(n,3) float64 hit points, as `Hits.points`."""
        return self._wrap(self._home.points())

    def normals(self) -> Any:
        """(n,3) float64 unit normals, as `Hits.normals`."""
        return self._wrap(self._home.normals())

    @property
    def error_bound(self) -> Any:
        """(n,) float64, as `Hits.error_bound`."""
        return self._wrap(self._home.error_bound)

    def spawn(self, directions: ArrayLike) -> Any:
        """(n,3) origins, as `Hits.spawn`."""
        return self._wrap(self._home.spawn(directions))

    def __len__(self) -> int:
        """Number of rays."""
        return int(self._home.t.shape[0])

    def __repr__(self) -> str:
        """Number of rays and where their hits are."""
        return f"Hits({len(self)} rays, in arrays of {type(self.t).__module__.partition('.')[0]})"
