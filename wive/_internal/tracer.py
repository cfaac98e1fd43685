"""What `wive.Scene` traces with: the tree over its mesh, on one backend."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from wive import _cpu
from wive._internal.options import Work
from wive._internal.picture import Image, Look
from wive._internal.points import Points
from wive._internal.precision import Floats
from wive._internal.rays import Rays

if TYPE_CHECKING:
    from wive._internal.inside_scene import SignOption
    from wive.all_hits import AllHits
    from wive.closest import Closest
    from wive.geoms import Geoms
    from wive.hits import Hits, Stats
    from wive.warp_kernels import Tree


class Tracer(Protocol):
    """The queries of a scene on one backend; never changed, so that a query sees one shape of the mesh.

    Queries take checked arguments, and return arrays of the library that the rays came in. Their second
    result is None unless `work.stats`.
    """

    @property
    def backend(self) -> str:
        """The backend's name."""

    @property
    def device(self) -> str | None:
        """The Warp device; None for CPU backends."""

    @property
    def lacks(self) -> tuple[str, ...]:
        """The options of queries that this backend doesn't have."""

    @property
    def bvh(self) -> _cpu.Bvh:
        """The tree in host memory."""

    @property
    def geoms(self) -> Geoms | None:
        """The meshes that the scene was made of; None if it is one."""

    @property
    def closed(self) -> bool:
        """Whether every edge is in an even number of triangles."""

    @property
    def tree(self) -> Tree:
        """The tree on the Warp device; ValueError for CPU backends."""

    def at_once(self, query: str, origins: Any, directions: Any, tmin: Any, tmax: Any) -> Any:
        """The answer with the usual options, if rays are arrays that need no check in Python; else None."""

    def intersect(self, rays: Rays, work: Work) -> tuple[Hits, Stats | None]:
        """Closest hits."""

    def occluded(self, rays: Rays, work: Work) -> tuple[Any, Stats | None]:
        """(n,) bool, whether anything is hit."""

    def count(self, rays: Rays, work: Work) -> tuple[Any, Stats | None]:
        """(n,) int32, the number of hits."""

    def intersect_all(self, rays: Rays, work: Work) -> tuple[AllHits, Stats | None]:
        """All hits."""

    def closest(self, points: Points, work: Work) -> Closest:
        """The surface's closest points."""

    def inside(self, points: Points, sign: SignOption, work: Work) -> Any:
        """(n,) bool, whether each point is inside; in the points' library and shape."""

    def signed_distance(self, points: Points, sign: SignOption, work: Work) -> Any:
        """(n,) distances, negative inside; in the points' library and shape."""

    def refitted(self, vertices: Floats, threads: int) -> Tracer:
        """A tracer of moved vertices, as many as before; threads 0 is every core."""

    def rows_renderer(self, camera: Image, image: Image, look: Look) -> Callable[[int, int], int]:
        """A function that renders rows [begin, end) into `image` and returns how many rays it traced."""
