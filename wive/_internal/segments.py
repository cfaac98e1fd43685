"""Line of sight: which segments between two points are free, docs/accuracy.md, "Line of sight".

The core decides whether a triangle separates the ends of a segment: cpu/core/separation.inc.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.arrays import NUMPY
from wive._internal.distant import MOST_COORDINATE
from wive._internal.error_bounds import ROUNDINGS, UNIT_ROUNDOFF
from wive._internal.host_arrays import host_arrays
from wive._internal.options import Work
from wive._internal.precision import FLOAT64, Floats
from wive._internal.progress import part
from wive._internal.ray_shapes import flat_ends
from wive._internal.rays import ALL_NUMPY, Rays
from wive._internal.shapes import Leading
from wive._internal.tracer import Tracer

# A point on a triangle is w0 v0 + w1 v1 + w2 v2. Computed in the precision of the scene, its coordinates are
# off by a roundoff of the corners' for each of: the sum of the weights, the products, and two additions.
POINT_ROUNDINGS = 4
UNDERFLOW = 2.0**-1060  # above what products of doubles lose below the smallest normal number
# In lengths of the segment. The first pass leaves out what is nearer to an end, because many triangles there
# contain that end; the second one goes farther than the ends by it, because t and rays are rounded.
MARGIN = 2.0**-10
# Segments at a time: hits of the second pass take memory.
CHUNK = 1 << 20


class Ends(NamedTuple):
    """One end of each segment."""

    rows: NDArray[np.float64]  # (n,3), or (1,3) if all segments share it
    error: float  # how far coordinates of a point on a surface are off, relative to them

    def part(self, begin: int, end: int) -> NDArray[np.float64]:
        """The rows of segments [begin, end)."""
        return self.rows if len(self.rows) == 1 else self.rows[begin:end]

    def usable(self) -> NDArray[np.bool_]:
        """(n,) or (1,) whether all coordinates are numbers that a ray may start from."""
        return np.asarray((np.abs(self.rows) <= MOST_COORDINATE).all(axis=1))


def visible(tracer: Tracer, faces: NDArray[np.int32], a: ArrayLike, b: ArrayLike, work: Work) -> Any:
    """(n,) bool in the library that `a` and `b` came in: whether nothing is between them."""
    (first, second), library = host_arrays("visible", a=a, b=b)
    first, second, leading = flat_ends(first, second)
    mesh, work = (tracer.bvh.vertices, faces), work._replace(touching=True)
    ends = _ends("a", first, mesh[0]), _ends("b", second, mesh[0])
    count = _count(*(len(end.rows) for end in ends))
    free = np.empty(count, np.bool_)
    free[:] = ends[0].usable() & ends[1].usable()
    lowest, highest = tracer.bvh.bounds.astype(np.float64)
    center = lowest + (highest - lowest) / 2 if np.isfinite(lowest).all() else np.zeros(3)
    for begin in range(0, count, CHUNK):
        end = min(begin + CHUNK, count)
        rows = ends[0].part(begin, end), ends[1].part(begin, end)
        with part(begin / count, end / count):
            free[begin:end] &= ~_blocked(tracer, mesh, rows, (ends[0].error, ends[1].error), center, work)
    answer = library.from_numpy(free)
    return answer if leading is None else Leading(library, leading)(answer)


def _ends(name: str, value: ArrayLike, vertices: Floats) -> Ends:
    rows: NDArray[Any] = arguments.vectors(name, value, FLOAT64)
    given = value.dtype if isinstance(value, np.ndarray) and value.dtype.kind == "f" else vertices.dtype
    roundoff = max(float(np.finfo(dtype).eps) / 2 for dtype in (vertices.dtype, given))
    return Ends(rows.reshape(-1, 3), POINT_ROUNDINGS * roundoff)


def _count(first: int, second: int) -> int:
    if first != second and 1 not in (first, second):
        raise ValueError(f"a and b must be equally many, or one of them (3,), got {first} and {second}")
    return second if first == 1 else first


def _blocked(
    tracer: Tracer,
    mesh: tuple[Floats, NDArray[np.int32]],
    ends: tuple[NDArray[np.float64], NDArray[np.float64]],
    errors: tuple[float, float],
    center: NDArray[np.float64],
    work: Work,
) -> NDArray[np.bool_]:
    """(n,) bool: whether a triangle that a segment meets separates its ends.

    Most blocked segments are found by the closest hit well inside them. Of the others all hits are looked at.
    """

    def between(prim: NDArray[np.int32], row: NDArray[np.int64]) -> NDArray[np.bool_]:
        constants = ROUNDINGS * UNIT_ROUNDOFF, UNDERFLOW
        return _cpu.between(*mesh, np.ascontiguousarray(prim), row, *ends, constants, errors, work.threads)

    origins, directions = _cpu.segment_rays(*ends, center.tolist(), work.threads)
    rays = Rays(origins, directions, MARGIN, 1 - MARGIN, NUMPY, ALL_NUMPY)
    with part(0, 0.5):
        closest, _ = tracer.intersect(rays, work._replace(touching=False))
    with part(0.5, 0.5):
        blocked = between(closest.prim, np.arange(len(origins)))
    (rest,) = np.nonzero(~blocked)
    if len(rest) == 0:
        return blocked
    rays = rays._replace(origins=origins[rest], directions=directions[rest], tmin=-MARGIN, tmax=1 + MARGIN)
    with part(0.5, 1):
        every, _ = tracer.intersect_all(rays, work)
    row = rest[every.ray]
    blocked[row[between(every.prim, row)]] = True
    return blocked
