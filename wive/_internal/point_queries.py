"""The queries of a scene that take points: the closest point of the surface, and what follows from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wive._internal import arguments
from wive._internal.points import check_points
from wive._internal.tracer import Tracer
from wive.closest import Closest


class PointQueries:
    """Queries of the tree that `_tracer` holds; each reads it once, because a refit replaces it."""

    _tracer: Tracer

    def closest(
        self, points: ArrayLike, max_distance: ArrayLike = np.inf, *, threads: int | None = None
    ) -> Closest:
        """The closest point of the surface to each point, not farther away than max_distance.

        Arguments:
            points: (n,3) real numbers, or of any other leading shape, such as the (x,y,z,3) of a grid, which
                the results then have in place of (n,). Used in the scene's precision. Warp, torch and DLPack
                arrays give results in arrays of their library, as for `intersect`.
            max_distance: a number, or one per point, (n,) or of the points' leading shape; a point at this
                very distance counts. A small one saves time.
            threads: how many to use; None is every core. For CPU backends.

        Of triangles at the same distance, as those that share the closest edge, the one with the lowest
        number is chosen. Results are the same bits on every backend, for every number of threads, however
        points are split into batches. The distance is exact but for one rounding to the scene's precision
        and an error far below that, docs/accuracy.md, "The error of a distance". Zero-area triangles are
        never chosen. A point that is NaN, infinite, masked or beyond 1e18 is close to nothing.

        Raises ValueError or TypeError, in one line naming the argument.

        >>> closest = scene.closest(points)
        >>> closest.distance, closest.prim, closest.points()
        """
        tracer = self._tracer
        work = arguments.work(tracer.backend, tracer.lacks, threads, None, "auto", False)
        return tracer.closest(check_points(points, max_distance, tracer.backend, tracer.device), work)
