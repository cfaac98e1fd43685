"""What `wive.Scene.closest` returns: the surface's closest point to each of many points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.known_meshes import OfMesh
from wive._internal.precision import Floats
from wive._internal.wrapping import Wrapping, from_home, keep_wrapped, library_name
from wive.geoms import Geoms
from wive.hits import OnSurface


class Closest(OnSurface, OfMesh):
    """The closest point of the surface to each of n points; of their leading shape if that is another.

    Arrays are NumPy's if the points were, else of the library and on the device that the points came in;
    `vertices` and `faces` are always NumPy's.

    Attributes:
        distance: (n,) float32, to the closest point; inf if no triangle is within the largest distance.
        prim: (n,) int32, row of `faces` that holds it, the lowest of those equally close; -1 if none does.
        uv: (n,2) float32, the closest point is (1-u-v) v0 + u v1 + v v2; NaN if there is none.
        vertices: (v,3) float32 and
        faces: (f,3) int32, the mesh that `prim` refers to.

    distance, uv and vertices are float64 for a float64 scene. `points()` are the closest points themselves.
    Pickles hold no mesh, as those of `Hits`.
    """

    distance: Floats

    def __init__(
        self,
        distance: Floats,
        prim: NDArray[np.int32],
        uv: Floats,
        vertices: Floats,
        faces: NDArray[np.int32],
        geoms: Geoms | None = None,
    ) -> None:
        """Keep the arrays."""
        vars(self).update(distance=distance, prim=prim, uv=uv, vertices=vertices, faces=faces, _geoms=geoms)

    def __len__(self) -> int:
        """Number of points."""
        return len(self.distance)

    def __repr__(self) -> str:
        """Number of points and of those that have a closest one."""
        return f"Closest({len(self)} points, {np.count_nonzero(self.mask)} within the largest distance)"


class WrappedClosest(Closest):
    """Closest points in arrays of another library or shape; `_home` holds the backend's."""

    _home: Any
    _wrapping: Wrapping

    def __init__(self, home: Any, wrapping: Wrapping) -> None:
        """Wrap distance, prim and uv of `home`; all else is computed when used."""
        keep_wrapped(self, home, wrapping, "distance", "prim", "uv")

    mask = from_home(Closest.mask)
    geom = from_home(Closest.geom)
    geom_prim = from_home(Closest.geom_prim)
    points = from_home(Closest.points)
    normals = from_home(Closest.normals)
    interpolate = from_home(Closest.interpolate)

    def __repr__(self) -> str:
        """Number of points, and the library of the arrays."""
        shape = tuple(self.prim.shape)
        count = shape[0] if len(shape) == 1 else shape
        return f"Closest({count} points, in arrays of {library_name(self.prim)})"
