"""A simple polygon's triangles, one ear after the other (Meisters 1975)."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterator

import numpy as np

# Of a polygon, in corners looked at: some seconds. Outlines of 100,000 corners need a third.
MOST_WORK = 30_000_000
# What is done for each corner, and for each triangle that may be an ear, takes as long as looking at so many.
WORK_PER_CORNER, WORK_PER_EAR = 50, 20
# In strips of so many corners, groups that are outside of the triangle are left out: by calls of NumPy that
# take as long as looking at so many.
LONG, GROUP, WORK_PER_CALL = 512, 32, 300

Triangles = list[tuple[int, int, int]]
Place = tuple[float, float]


class Tangled(Exception):
    """A polygon whose ears take too long to find."""


def ears(u: list[float], v: list[float]) -> Triangles:
    """Triangles of a polygon in the plane, counter-clockwise, as numbers of its corners.

    Each has area and contains no other corner, not even on its edges, unless the polygon crosses itself.
    """
    ring = _Ring(u, v)
    queue = deque(corner for corner in range(len(u)) if not ring.blocks[corner])
    found: Triangles = []
    while len(found) < len(u) - 3:
        if queue:
            corner = queue.popleft()
            if ring.is_gone[corner] or not ring.is_ear(corner):
                continue
        else:  # the polygon crosses itself: what is left has no ear
            corner = ring.some
        before, after = ring.before[corner], ring.after[corner]
        found.append((before, corner, after))
        ring.cut(corner)
        # Only an ear's neighbours can become ears.
        queue.extend(neighbour for neighbour in (before, after) if not ring.blocks[neighbour])
    last = ring.some
    found.append((ring.before[last], last, ring.after[last]))
    return found


class _Ring:
    """The corners that are left, in order, and those that may lie in an ear of others."""

    def __init__(self, u: list[float], v: list[float]) -> None:
        count = len(u)
        self._u, self._v = u, v
        self.before = [count - 1, *range(count - 1)]
        self.after = [*range(1, count), 0]
        self.is_gone = [False] * count
        self.some = 0
        self._work = 0
        self._spend(WORK_PER_CORNER * count)
        # Corners that are not convex: others are inside of no ear, and cutting ears makes no more of them.
        self.blocks = [self._turn(self.before[i], i, self.after[i]) <= 0 for i in range(count)]
        self._sort([i for i in range(count) if self.blocks[i]])

    def _sort(self, blocking: list[int]) -> None:
        """By u, so that an ear looks at a strip of the polygon."""
        self._order = sorted(blocking, key=self._u.__getitem__)
        self._sorted_u = [self._u[i] for i in self._order]
        self._left = len(blocking)
        begins = np.arange(0, len(blocking), GROUP)
        sides = [np.array([side[i] for i in self._order]) for side in (self._u, self._v)]
        bounds = [f.reduceat(side, begins) for side in sides for f in (np.minimum, np.maximum)]
        self._groups = np.array(bounds if blocking else np.empty((4, 0)))

    def _turn(self, a: int, b: int, c: int) -> float:
        u, v = self._u, self._v
        return (u[b] - u[a]) * (v[c] - v[a]) - (v[b] - v[a]) * (u[c] - u[a])

    def is_ear(self, corner: int) -> bool:
        """Whether the triangle at a convex corner contains no other corner."""
        u, v = self._u, self._v
        triangle = (self.before[corner], corner, self.after[corner])
        (au, av), (bu, bv), (cu, cv) = places = [(u[i], v[i]) for i in triangle]
        first = bisect_left(self._sorted_u, min(au, bu, cu))
        last = bisect_right(self._sorted_u, max(au, bu, cu))
        is_long = last - first >= LONG
        self._spend(WORK_PER_CALL if is_long else WORK_PER_EAR + last - first)
        for i in self._grouped(first, last, places) if is_long else self._order[first:last]:
            if not self.blocks[i]:
                continue
            pu, pv = u[i], v[i]
            if (
                (bu - au) * (pv - av) >= (bv - av) * (pu - au)
                and (cu - bu) * (pv - bv) >= (cv - bv) * (pu - bu)
                and (au - cu) * (pv - cv) >= (av - cv) * (pu - cu)
                # The bridge to a hole passes its ends twice: what lies at a corner is not inside.
                and (pu, pv) not in places
            ):
                return False
        return True

    def _grouped(self, first: int, last: int, triangle: list[Place]) -> Iterator[int]:
        """The corners of a long strip, but for groups whose bounds are outside of the triangle."""
        group = first // GROUP
        low_u, high_u, low_v, high_v = self._groups[:, group : (last - 1) // GROUP + 1]
        may_be_inside = np.ones(len(low_u), bool)
        for (au, av), (bu, bv) in zip(triangle, (*triangle[1:], triangle[0]), strict=True):
            u, v = low_u if bv > av else high_u, high_v if bu > au else low_v
            may_be_inside &= (bu - au) * (v - av) >= (bv - av) * (u - au)
        self._spend(len(low_u))
        for begin in (GROUP * (group + np.flatnonzero(may_be_inside))).tolist():
            self._spend(GROUP)
            yield from self._order[max(first, begin) : min(last, begin + GROUP)]

    def _spend(self, work: int) -> None:
        self._work += work
        if self._work > MOST_WORK:
            what = f"a polygon of {len(self._u):,} corners is too tangled"
            raise Tangled(f"{what}: triangulate the mesh before it is exported")

    def cut(self, corner: int) -> None:
        """Take a corner out."""
        before, after = self.before[corner], self.after[corner]
        self.after[before], self.before[after] = after, before
        self.is_gone[corner] = True
        self.some = after
        for i in (before, corner, after):
            if self.blocks[i] and (i == corner or self._turn(self.before[i], i, self.after[i]) > 0):
                self.blocks[i] = False
                self._left -= 1
        if 2 * self._left < len(self._order):
            self._sort([i for i in self._order if self.blocks[i]])
