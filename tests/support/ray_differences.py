"""Reasons why two correct tracers may differ for one ray, decided in double precision.

Both sides compute in float32, so each may differ from the truth by its own rounding and no more. A difference
is explained if the exact ray passes so close to a change of the result that rounding can move it across.
How close is derived here to first order, with u = 2^-24, for a ray o + t d and a triangle v0 v1 v2. Its
edges are e0 = v2 - v1, e1 = v1 - v0, e2 = v2 - v0, the longest L; its normal N = e1 x e2 has the angle
theta to the ray. The corner distance S = max |v - o| bounds what is rounded first, v - o, with an error of
u S; the hit is no further than S, L <= 2S, and L^2 >= |N|.

Edges. Every test finds the distance from the ray to an edge as a product of d, the edge and a vertex
relative to o, and so with an error in proportion to u S:
- Moeller-Trumbore (fast), edges at v0: the cross product errs by 3 sqrt(2) u S |d|, its dot product with
the edge by (3 sqrt(2) + 4 sqrt(3)) u S |d| |e|, the distance therefore by 11.2 u S. Edge e0 is tested as
U + V <= det, which adds three errors: 11.2 u S (|e1| + |e2|) + 10 u |e1| |e2|, over |e0|. As |e1| |e2| <=
S (|e1| + |e2|), that is below 21.2 u S (|e0| + |e1| + |e2|) / |e0|.
- Pluecker (Embree's robust mode): 11.3 u S by the cross product, 10.4 u S by the dot product, u S by v - o.
- Woop (wive's watertight mode): 6 u S by the sheared vertices, 2 u |e| by the two products.
All are below EDGE u S, in fast mode times (|e0| + |e1| + |e2|) / |e0| for e0. A box test misplaces planes
by u |o| + 3 u S; a ray that meets a triangle further than that from its edges meets its box.

Distance. Embree's t = N.(v0 - o) / N.d: N errs by 5.7 u L^2, which tilts the plane about v0 and moves t by
5.7 u L^3 / (|N| |d| cos theta); the two dot products, v - o and the division add 14.4 u S / (|d| cos
theta).
wive's fast t = e2.q / e1.p has 11.2 u S L^2 / (|N| |d| cos theta) from q and p each. With the slope L^2 /
(|N| cos theta) all are below DEPTH u S slope / |d|. wive's watertight t is computed in double and rounded
once; at an edge it is clamped to the triangle, elsewhere it errs by half an ulp.
Boxes cull what lies behind the closest hit: misplaced planes add BOX u |o| slope / |d|.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

UNIT_ROUNDOFF = 2.0**-24
DOUBLE_ROUNDOFF = 2.0**-53
EDGE, DEPTH, BOX = 24.0, 32.0, 4.0

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Crossing:
    """How n rays meet one triangle each.

    t: where the ray meets the triangle's plane. inside: whether that is within the triangle. near_edge:
    whether float32 may decide `inside` either way. roundoff: u S / |d|, a rounding error of position as a
    t. slope: by how much the plane magnifies it, 1 at best, large for grazing rays and slivers. t_error:
    how far a t computed in float32 may be off. order_error: how far behind a farther hit this one may
    seem.
    """

    t: Floats
    inside: Bools
    near_edge: Bools
    roundoff: Floats
    slope: Floats
    t_error: Floats
    order_error: Floats

    def may_be_hit_at(self, t: NDArray[np.float32], *, rounded_once: bool = False) -> Bools:
        """Whether a tracer may report a hit at t, computed in float32, or in double and rounded once."""
        allowed = self.t_error
        if rounded_once:
            half_ulp = UNIT_ROUNDOFF * np.abs(self.t) + DOUBLE_ROUNDOFF / UNIT_ROUNDOFF * self.t_error
            allowed = np.where(self.near_edge, self.t_error, half_ulp)
        return (self.inside | self.near_edge) & (np.abs(t - self.t) <= allowed)

    @property
    def may_be_missed(self) -> Bools:
        """Whether a tracer may report a miss, of a ray that starts at t = 0."""
        return ~self.inside | self.near_edge | (self.t <= self.t_error)


def cross_triangles(origins: Floats, directions: Floats, corners: Floats, *, fast: bool) -> Crossing:
    """Rays (n,3) against triangles (n,3,3), one each. The arguments are float32 numbers held as float64."""
    relative = corners - origins[:, None]
    edges = np.roll(relative, -1, axis=1) - relative  # v1 - v0, v2 - v1, v0 - v2
    lengths = np.linalg.norm(edges, axis=2)
    normal = np.cross(edges[:, 0], -edges[:, 2])
    facing = np.einsum("ij,ij->i", normal, directions)
    speed = np.linalg.norm(directions, axis=1)
    corner_distance = np.linalg.norm(relative, axis=2).max(axis=1)
    place = np.linalg.norm(origins, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("ij,ij->i", normal, relative[:, 0]) / facing
        slope = lengths.max(axis=1) ** 2 * speed / np.abs(facing)

    margin = np.repeat(EDGE * corner_distance[:, None], 3, axis=1)
    if fast:
        margin[:, 1] *= lengths.sum(axis=1) / lengths[:, 1]
    margin = UNIT_ROUNDOFF * (margin + BOX * place[:, None])
    volumes = np.einsum("ij,ikj->ik", directions, np.cross(relative, edges)) * np.sign(facing)[:, None]
    t_error = DEPTH * UNIT_ROUNDOFF * corner_distance * slope / speed
    return Crossing(
        t=t,
        inside=(facing != 0) & (volumes >= 0).all(axis=1),
        near_edge=(distance_to_edges(directions / speed[:, None], relative) <= margin).any(axis=1),
        roundoff=UNIT_ROUNDOFF * corner_distance / speed,
        slope=slope,
        t_error=t_error,
        order_error=t_error + BOX * UNIT_ROUNDOFF * place * slope / speed,
    )


def distance_to_edges(unit_directions: Floats, relative: Floats) -> Floats:
    """(n,3) distances of lines through 0 from the segments v0 v1, v1 v2, v2 v0, seen along the lines."""
    along = np.einsum("ij,ikj->ik", unit_directions, relative)
    start = relative - along[..., None] * unit_directions[:, None]
    segment = np.roll(start, -1, axis=1) - start
    squared = np.maximum(np.einsum("ikj,ikj->ik", segment, segment), np.finfo(np.float64).tiny)
    nearest = np.clip(-np.einsum("ikj,ikj->ik", start, segment) / squared, 0, 1)
    return np.asarray(np.linalg.norm(start + nearest[..., None] * segment, axis=2))


@dataclass(frozen=True)
class Answers:
    """The results of one side for n rays: t, and prim, -1 on a miss."""

    t: NDArray[np.float32]
    prim: NDArray[np.int32]


# Explanations of a difference. The first is about t alone: the slope of the triangle allows values of t more
# than two ulp of the corner distance apart. The others are about the triangle: the ray meets its border;
# or it meets two triangles at the same t, or at values of t that differ by no more than the slopes allow.
LABELS = ("steep t", "edge tie", "coincident", "grazing", "unexplained")
STEEP = 64.0  # the slope from which a tie is called grazing: less than a degree on a well-shaped triangle


def explain(
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    mesh: tuple[NDArray[np.float32], NDArray[np.int32]],
    ours: Answers,
    theirs: Answers,
    *,
    fast: bool,
) -> NDArray[np.str_]:
    """For each ray one of LABELS, or "" if both miss, or hit the same triangle at the same t (two ulp).

    `ours` is wive's side, whose t in watertight mode is held to half an ulp; `theirs` is Embree's.
    """
    vertices, faces = mesh

    def crossing(rays: NDArray[np.intp], prim: NDArray[np.int32]) -> Crossing:
        corners = vertices[faces[prim[rays]]].astype(np.float64)
        return cross_triangles(
            origins[rays].astype(np.float64), directions[rays].astype(np.float64), corners, fast=fast
        )

    label = np.full(len(origins), "", dtype="<U11")
    we_hit, they_hit = ours.prim >= 0, theirs.prim >= 0

    same = np.flatnonzero(we_hit & (ours.prim == theirs.prim))
    met = crossing(same, ours.prim)
    allowed = met.may_be_hit_at(ours.t[same], rounded_once=not fast) & met.may_be_hit_at(theirs.t[same])
    two_ulp = 4 * met.roundoff
    apart = np.abs(ours.t[same].astype(np.float64) - theirs.t[same]) > two_ulp
    label[same] = np.where(allowed, np.where(apart, "steep t", ""), "unexplained")

    one = np.flatnonzero(we_hit ^ they_hit)
    reported = Answers(np.where(we_hit, ours.t, theirs.t), np.where(we_hit, ours.prim, theirs.prim))
    met = crossing(one, reported.prim)
    ours_alone = we_hit[one] & (not fast)
    allowed = met.may_be_hit_at(reported.t[one])
    allowed &= ~ours_alone | met.may_be_hit_at(reported.t[one], rounded_once=True)
    allowed &= met.may_be_missed
    label[one] = np.where(allowed, "edge tie", "unexplained")

    two = np.flatnonzero(we_hit & they_hit & (ours.prim != theirs.prim))
    mine, other = crossing(two, ours.prim), crossing(two, theirs.prim)
    allowed = mine.may_be_hit_at(ours.t[two], rounded_once=not fast) & other.may_be_hit_at(theirs.t[two])
    tied = np.abs(mine.t - other.t) <= mine.order_error + other.order_error
    nearer_may_be_missed = np.where(mine.t < other.t, mine.may_be_missed, other.may_be_missed)
    on_edge = np.where(tied, mine.near_edge & other.near_edge, True)
    steep = np.maximum(mine.slope, other.slope) > STEEP
    name = np.where(on_edge, "edge tie", np.where(steep, "grazing", "coincident"))
    label[two] = np.where(allowed & (tied | nearer_may_be_missed), name, "unexplained")
    return label
