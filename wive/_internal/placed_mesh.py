"""The scene over a trimesh mesh that is moved to the coordinates' origin and scaled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.distant import Ball
from wive._internal.inside import Closedness
from wive._internal.precision import Floats, Real
from wive.scene import Scene

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

# Hits of one ray that are at most this fraction of the mesh's size apart are in one place.
SAME_PLACE = 1e-8
# The largest power of two by which a mesh is scaled, and that up to which products of five lengths are
# numbers that keep their digits.
MOST_POWER, PLAIN_POWER = 1000, 200
# Differences of t, in units of the scene, that the scene's numbers may hide; those of float64 also once for
# each unit that the mesh is away from the coordinates' origin, as its own vertices are rounded.
UNSURE = {"float32": 2.0**-20, "float64": 2.0**-46}


class Found(NamedTuple):
    """Hits of rays, h in all: ray by ray, from near to far."""

    ray: Int64
    prim: NDArray[np.int32]
    uv: Floats

    def at(self, rows: NDArray[Any]) -> Found:
        """Some of the hits."""
        return Found(self.ray[rows], self.prim[rows], self.uv[rows])


class PlacedMesh:
    """The scene over one state of a mesh.

    Triangles with a corner that is NaN or infinite keep their number and are never hit.
    """

    def __init__(self, mesh: Any, scale_to_box: bool, real: Real, options: dict[str, Any]) -> None:
        """Build the tree."""
        self.vertices: Float64 = np.ascontiguousarray(np.asarray(mesh.vertices, np.float64))
        faces = np.asarray(mesh.faces)
        if faces.size and not 0 <= faces.min() <= faces.max() < len(self.vertices):
            face = int(np.argmax(((faces < 0) | (faces >= len(self.vertices))).any(axis=1)))
            raise ValueError(
                f"faces of the mesh must index its {len(self.vertices)} vertices from 0, "
                f"got {faces[face].tolist()} in face {face}"
            )
        finite = np.asarray(np.isfinite(self.vertices).all(axis=1))
        if finite.all():
            bounds = mesh.bounds
        else:
            whole = finite[faces].all(axis=1)
            self.vertices = np.where(finite[:, None], self.vertices, 0)
            faces = np.where(whole[:, None], faces, 0)
            corners = self.vertices[faces[whole]].reshape(-1, 3)
            bounds = np.array([corners.min(axis=0), corners.max(axis=0)]) if len(corners) else None
        self.bounds: Float64 = np.array([[np.inf] * 3, [-np.inf] * 3]) if bounds is None else np.array(bounds)
        self._origin, self.size, power = np.zeros(3), 0.0, 0
        if bounds is not None:
            self._origin = self.bounds.mean(axis=0)
            self.size = float(np.max(self.bounds[1] - self.bounds[0]))
        if 0 < self.size < np.inf:
            power = max(-MOST_POWER, min(-round(np.log2(self.size)), MOST_POWER))
        self._scale = 2.0**power if scale_to_box else 1.0
        self._unit = 2.0**power if abs(power) > PLAIN_POWER else 1.0
        self.closedness: Closedness | None = None  # what `inside.closedness` says, when asked
        self._real = real
        self._ball = Ball.around(self.bounds)
        self.scene = Scene(real.array((self.vertices - self._origin) * self._scale), faces, **options)
        away = float(np.abs(self._origin).max()) * self._scale
        self._unsure = UNSURE[self.scene.precision] + UNSURE["float64"] * away

    def near(self, origins: Float64, directions: Float64) -> Float64:
        """The origins of rays, those far away moved along their rays to where the mesh is near."""
        if not self._ball.may_have_far(origins):
            return origins
        return self._ball.just_before(origins, directions)

    def rays(self, origins: Float64, directions: Float64) -> tuple[Floats, Floats]:
        """The rays in the scene's units and dtype."""
        with np.errstate(over="ignore", invalid="ignore"):
            placed = (origins - self._origin) * self._scale
        return self._real.array(placed), self._real.array(directions)

    def points(self, found: Found, origins: Float64, directions: Float64) -> Float64:
        """(h,3) points at which rays meet the planes of the triangles they hit, in the mesh's own float64."""
        ray, prim, uv = found
        vertices, faces, unit = self.vertices, self.scene.faces, self._unit
        if unit == 1:
            return _cpu.points_on_rays(vertices, faces, prim, uv, ray, origins, directions)
        with np.errstate(over="ignore"):  # of origins that the mesh is not ahead of
            vertices, origins = vertices * unit, origins * unit
        return _cpu.points_on_rays(vertices, faces, prim, uv, ray, origins, directions) / unit

    def closest_points(self, points: Float64, threads: int | None) -> tuple[Float64, Float64, Int64]:
        """(n,3) closest points, (n,) distances and (n,) triangles, in the mesh's own float64."""
        rows, _ = self.rays(points, points)
        prim = self.scene.closest(rows, threads=threads).prim
        # The scene's vertices are rounded: where on the triangle is found again from the mesh's own.
        vertices, unit = self.vertices, self._unit
        with np.errstate(over="ignore"):
            scaled = (vertices, points) if unit == 1 else (vertices * unit, points * unit)
        closest, distance = _cpu.closest_on(scaled[0], self.scene.faces, prim, scaled[1])
        return closest / unit, distance / unit, prim.astype(np.int64)

    def every_hit(
        self, origins: Float64, directions: Float64, threads: int | None
    ) -> tuple[Found, NDArray[np.bool_] | None]:
        """All hits, and whether each is in the same place as the one before; None if none is."""
        every = self.scene.intersect_all(*self.rays(origins, directions), threads=threads)
        found, t = Found(every.ray, every.prim, every.uv), every.t
        (close,) = np.nonzero(t[1:] - t[:-1] <= self._unsure + self._unsure * t[1:])
        close = close[found.ray[close] == found.ray[close + 1]]
        if len(close) == 0:
            return found, None
        # Hits that are close together are sorted again, by float64: t may have hidden their order.
        rows = np.union1d(close, close + 1)
        follows = np.isin(rows, close + 1)
        some = found.at(rows)
        along = self.points(some, origins, directions) - origins[some.ray]
        distance = np.einsum("ij,ij->i", along, directions[some.ray])
        order = np.lexsort((some.prim, distance, np.cumsum(~follows)))
        found.prim[rows], found.uv[rows] = some.prim[order], some.uv[order]
        again = np.zeros(len(found.ray), np.bool_)
        again[rows[1:]] = follows[1:] & (np.diff(distance[order]) <= SAME_PLACE * self.size)
        return found, again
