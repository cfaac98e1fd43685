"""The queries of a scene that take points: the closest point of the surface, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments, options
from wive._internal.gradients import warn_of_lost_gradients
from wive._internal.inside_scene import SIGNS, SignOption
from wive._internal.options import Work
from wive._internal.points import Points, check_points
from wive._internal.precision import Floats
from wive._internal.progress import ProgressOption, checked_progress, reported
from wive._internal.shapes import shape_of
from wive._internal.tracer import Tracer
from wive.closest import Closest


class PointQueries:
    """Queries of the tree that `_tracer` holds; each reads it once, because a refit replaces it."""

    _tracer: Tracer

    def closest(
        self,
        points: ArrayLike,
        max_distance: ArrayLike = np.inf,
        *,
        threads: int | None = None,
        progress: ProgressOption = None,
    ) -> Closest:
        """The closest point of the surface to each point, not farther away than max_distance.

        Arguments:
            points: (n,3) real numbers, or of any other leading shape, such as the (x,y,z,3) of a grid, which
                the results then have in place of (n,). Used in the scene's precision. Warp, torch and DLPack
                arrays give results in arrays of their library, as for `intersect`.
            max_distance: a number, or one per point, (n,) or of the points' leading shape; a point at this
                very distance counts. A small one saves time.
            threads: how many to use; None is every core. For CPU backends.
            progress: True shows a bar, if there is tqdm; or a callable of (done, total) in points, as for
                `Scene`.

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
        work = _work(tracer, threads)
        checked = check_points(points, max_distance, tracer.backend, tracer.device)
        warn_of_lost_gradients("closest", points=points)
        closest: Closest = _reported(progress, checked, lambda: tracer.closest(checked, work))
        return closest

    def contains(
        self,
        points: ArrayLike,
        *,
        sign: SignOption = "crossings",
        threads: int | None = None,
        progress: ProgressOption = None,
    ) -> NDArray[np.bool_]:
        """(n,) bool: whether each point is inside the mesh.

        Arguments:
            points: as for `closest`.
            threads, progress: as for `closest`.
            sign: "crossings" for closed meshes: a point is inside if a ray from there crosses the surface an
                odd number of times, which is decided without error at edges and vertices, too; where meshes
                overlap, an even number of them is outside. "winding" for meshes with holes, gaps and
                overlaps: inside if the mesh winds round the point more than half, by the generalised winding
                number (Barill and others 2018, to 0.03). Triangles must be wound alike then; computed on
                the host; the first call makes a table over the tree.
            threads: how many to use; None is every core. For CPU backends.

        A point on the surface may be inside or not; one that is NaN, infinite or masked is not. If a mesh
        is not closed, several rays have to agree, except for arrays on a Warp device, where one decides.

        Raises ValueError or TypeError, in one line naming the argument.
        """
        tracer, work = self._tracer, _work(self._tracer, threads)
        arguments.choice("sign", sign, SIGNS)
        checked = _checked(tracer, points)
        inside: NDArray[np.bool_] = _reported(progress, checked, lambda: tracer.inside(checked, sign, work))
        return inside

    def signed_distance(
        self,
        points: ArrayLike,
        *,
        sign: SignOption = "crossings",
        threads: int | None = None,
        progress: ProgressOption = None,
    ) -> Floats:
        """(n,) the distance of each point to the surface, negative inside; inf for a point that is NaN.

        Arguments are those of `contains`, which decides the sign; the distance is that of `closest`. In
        trimesh it is positive inside, and `wive.trimesh` follows that.

        >>> grown = scene.signed_distance(points) < 0.1
        """
        tracer, work = self._tracer, _work(self._tracer, threads)
        arguments.choice("sign", sign, SIGNS)
        checked = _checked(tracer, points)
        warn_of_lost_gradients("signed_distance", points=points)
        distance: Floats = _reported(progress, checked, lambda: tracer.signed_distance(checked, sign, work))
        return distance


def _work(tracer: Tracer, threads: int | None) -> Work:
    return options.work(tracer.backend, tracer.lacks, threads, None, "auto", False)


def _reported(progress: ProgressOption, points: Points, work: Callable[[], Any]) -> Any:
    count = shape_of("points", points.points, points.libraries[0])[0]
    return reported(checked_progress(progress), count, "point", "searching", work)


def _checked(tracer: Tracer, points: ArrayLike) -> Points:
    return check_points(points, np.inf, tracer.backend, tracer.device)
