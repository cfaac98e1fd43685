"""The truth about closest points: every point against every triangle, in integers and fractions.

It shares no formula with the core: the nearest point of the plane, of the edges' lines and the corners are
candidates if they lie on the triangle, and the nearest of them counts.
"""

from fractions import Fraction
from math import isqrt

import numpy as np

from support.oracle import cross, dot, integers, unit_of


def squared_distances(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,f) exact squared distances, as fractions; None for triangles without an area."""
    unit = unit_of(vertices, points) - 29  # doubles have 29 bits more
    corners = integers(vertices, unit)[faces]
    answer = np.full((len(points), len(faces)), None, object)
    scale = Fraction(2) ** (2 * unit)
    for i, p in enumerate(integers(points, unit)):
        for j, (a, b, c) in enumerate(corners):
            normal = cross(b - a, c - a)
            area = dot(normal, normal)
            if area != 0:
                answer[i, j] = scale * min(_candidates(a, b, c, p, normal, area))
    return answer


def _candidates(
    a: np.ndarray, b: np.ndarray, c: np.ndarray, p: np.ndarray, normal: np.ndarray, area: int
) -> list[Fraction]:
    found = [Fraction(dot(p - corner, p - corner)) for corner in (a, b, c)]
    sides = []
    for one, other in ((a, b), (b, c), (c, a)):
        side, to = other - one, p - one
        along, length = dot(to, side), dot(side, side)
        if 0 < along < length:
            found.append(Fraction(dot(to, to)) - Fraction(along * along, length))
        sides.append(dot(normal, cross(side, to)) > 0)
    if all(sides):
        found.append(Fraction(dot(normal, p - a) ** 2, area))
    return found


def root(square: Fraction) -> Fraction:
    """The square root, off by less than 2^-100 of itself."""
    if square == 0:
        return square
    shift = max(0, 220 - square.numerator.bit_length() + square.denominator.bit_length()) // 2 * 2
    return Fraction(isqrt((square.numerator << shift) // square.denominator), 1 << shift // 2)


def error_bounds(
    vertices: np.ndarray, faces: np.ndarray, distance: np.ndarray, prim: np.ndarray
) -> np.ndarray:
    """(n,) the bound of docs/accuracy.md, "The error of a distance", without the last rounding."""
    a, b, c = vertices.astype(np.float64)[faces].swapaxes(0, 1)
    longest = np.max([np.linalg.norm(x - y, axis=1) for x, y in ((a, b), (b, c), (c, a))], axis=0)
    with np.errstate(divide="ignore"):
        thinness = longest**2 / np.linalg.norm(np.cross(b - a, c - a), axis=1)
    far, size = distance.astype(np.float64), longest[prim]
    return np.minimum(2.0**-46 * thinness[prim] * (far + size), 2.0**-23 * size + 2.0**-50 * far)
