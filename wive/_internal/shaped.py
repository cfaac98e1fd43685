"""Answers in the leading shape of the rays, such as (h,w) for the rays of a picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import ArrayLike

from wive._internal.arrays import library_of
from wive._internal.options import Work
from wive._internal.precision import Floats
from wive._internal.ray_shapes import flat_directions, flat_rays
from wive._internal.rays import Rays
from wive._internal.shapes import Leading
from wive._internal.wrapping import Wrapping
from wive.all_hits import AllHits
from wive.hits import Hits, Stats, WrappedHits


def query_shaped(
    query: Callable[[Rays, Work], tuple[Any, Stats | None]], rays: Rays, work: Work
) -> tuple[Any, Stats | None]:
    """What a tracer's `query` returns for rays of any leading shape, in that shape.

    `AllHits` has no such shape: its rays are numbered in C order.
    """
    flat, leading = flat_rays(rays)
    answer, counters = query(flat, work)
    shape = Leading(rays.library, leading)
    if counters is not None:
        counters = Stats(*map(shape, counters))
    if isinstance(answer, Hits):
        return ShapedHits(answer, shape), counters
    return answer if isinstance(answer, AllHits) else shape(answer), counters


class ShapedHits(WrappedHits):
    """The closest hits of rays of some leading shape; `_home` holds those of the same rays as (n,3)."""

    _leading: Leading

    def __init__(self, home: Hits, leading: Leading) -> None:
        """Keep the flat hits; arrays have their memory."""
        super().__init__(home, Wrapping(leading.library, "cpu", leading))
        vars(self).update(_leading=leading)

    def spawn(self, directions: ArrayLike) -> Floats:
        """Origins as `Hits.spawn`, of the hits' shape and (3,); so are directions, or (3,) for all."""
        flat = flat_directions(directions, library_of(directions), self._leading.shape)
        spawned: Floats = self._leading(self._home.spawn(flat))
        return spawned

    def __reduce__(self) -> tuple[Any, tuple[Hits, Leading]]:
        """Copies and pickles hold the arrays once."""
        return ShapedHits, (self._home, self._leading)

    def __repr__(self) -> str:
        """What the flat hits show, with the shape of the rays."""
        return repr(self._home).replace(f"({len(self)} rays", f"({self._leading.shape} rays", 1)
