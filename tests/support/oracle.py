"""The truth by brute force: every ray against every triangle in integers and fractions, nothing rounded.

It shares no formula with the core beyond the definition: the line o + t d meets the plane of (a, b, c) at
t = (a - o) . n / (d . n), n = (b - a) x (c - a), and the point's barycentrics are ratios of volumes.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

LARGEST = Fraction(np.finfo(np.float32).max.item())
OVERFLOW = LARGEST + Fraction(2) ** 103  # half a unit in the last place above: rounds to infinity


@dataclass(frozen=True)
class Truth:
    """The right results of the queries, to the bit."""

    t: np.ndarray
    prim: np.ndarray
    uv: np.ndarray
    occluded: np.ndarray


@dataclass(frozen=True)
class Meetings:
    """Each line (n) against each triangle (f), in Python's integers."""

    inside: np.ndarray  # (n, f) whether it meets the closed triangle, not edge-on
    weights: np.ndarray  # (n, f, 3) volumes opposite to each corner
    determinant: np.ndarray  # (n, f)
    height: np.ndarray  # (n, f) t = height / determinant * scale
    scale: Fraction

    def t(self, ray: int, face: int) -> Fraction:
        return Fraction(self.height[ray, face], self.determinant[ray, face]) * self.scale


def meetings(
    vertices: np.ndarray,
    faces: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    moved: bool = False,
) -> Meetings:
    """All lines against all triangles. `moved`: the origins are moved by (e, e^2, e^3), e = 2^-60.

    If coordinates are multiples of 1/4 and below 32, the move changes no sign but that of zero.
    """
    unit, direction_unit = unit_of(vertices, origins), unit_of(directions)
    o = integers(origins, unit)[:, None]
    corners = integers(vertices, unit)[faces]
    if moved:
        unit -= 180
        o, corners = o * 2**180, corners * 2**180
        o = o + np.array([2 ** (power - unit) for power in (-60, -120, -180)], object)
    a, b, c = corners.swapaxes(0, 1)[:, None]
    d = integers(directions, direction_unit)[:, None]
    normal = cross(b - a, c - a)
    weights = np.stack(
        [dot(d, cross(b - o, c - o)), dot(d, cross(c - o, a - o)), dot(d, cross(a - o, b - o))], axis=-1
    )
    determinant = dot(d, normal)
    turned = weights * np.where(determinant < 0, -1, 1)[..., None]
    inside = (determinant != 0) & (turned >= 0).all(axis=-1)
    scale = Fraction(2) ** (unit - direction_unit)
    return Meetings(inside, weights, determinant, dot(a - o, normal), scale)


def truth(
    vertices: np.ndarray,
    faces: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    tmin: np.ndarray,
    tmax: np.ndarray,
) -> Truth:
    """The closest hit of each ray whose rounded t lies in [tmin, tmax], which are (1,) or (n,)."""
    return truth_within(meetings(vertices, faces, origins, directions), tmin, tmax)


def truth_within(met: Meetings, tmin: np.ndarray, tmax: np.ndarray) -> Truth:
    """`truth` of rays that were met with triangles before."""
    count = len(met.inside)
    tmin, tmax = np.broadcast_to(tmin, count), np.broadcast_to(tmax, count)
    t = np.full(count, np.inf, np.float32)
    uv = np.full((count, 2), np.nan, np.float32)
    prim = np.full(count, -1, np.int32)
    for ray in range(count):
        hits = [(met.t(ray, face), int(face)) for face in np.flatnonzero(met.inside[ray])]
        hits = [hit for hit in hits if within(hit[0], tmin[ray], tmax[ray])]
        if not hits:
            continue
        distance, face = min(hits)
        t[ray], prim[ray] = nearest_float(distance), face
        for k in range(2):
            uv[ray, k] = nearest_float(Fraction(met.weights[ray, face, k + 1], met.determinant[ray, face]))
    return Truth(t, prim, uv, prim >= 0)


def within(t: Fraction, tmin: float, tmax: float) -> bool:
    """Whether t, rounded, lies in the interval; a t below zero does not lie at a tmin of zero."""
    return bool(tmin <= nearest_float(t) <= tmax) and not (t < 0 <= tmin)


def crossings(
    vertices: np.ndarray, faces: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """(n,) number of triangles that each ray from t = 0 on crosses, by moving the origins."""
    met = meetings(vertices, faces, origins, directions)
    passed = meetings(vertices, faces, origins, directions, moved=True).inside
    ahead = met.height * np.where(met.determinant < 0, -1, 1) >= 0
    return (passed & ahead).sum(axis=1)


def nearest_float(x: Fraction) -> np.float32:
    """The float32 nearest to x, ties to even; a zero is +0."""
    if abs(x) >= OVERFLOW:
        return np.float32(np.inf if x > 0 else -np.inf)
    guess = np.float32(float(min(max(x, -LARGEST), LARGEST)))
    around = [guess, *(np.nextafter(guess, np.float32(side * np.inf)) for side in (1, -1))]
    best = min(
        (f for f in around if np.isfinite(f)),
        key=lambda f: (abs(Fraction(f.item()) - x), int(f.view(np.uint32)) & 1),
    )
    return np.float32(best + np.float32(0))


def unit_of(*arrays: np.ndarray) -> int:
    """The exponent of a power of two that divides all values, which are float32."""
    return min(int(np.frexp(a[a != 0].astype(np.float64))[1].min(initial=0)) for a in arrays) - 24


def integers(values: np.ndarray, unit: int) -> np.ndarray:
    """values / 2^unit as Python's integers."""
    return np.frompyfunc(lambda x: int(math.ldexp(x, -unit)), 1, 1)(values.astype(np.float64))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    (ax, ay, az), (bx, by, bz) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
