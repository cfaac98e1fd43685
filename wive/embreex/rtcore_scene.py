"""The scene of embreex, and its only query."""

from __future__ import annotations

from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments
from wive._internal.options import AccuracyOption
from wive._internal.precision import FLOAT32, Floats
from wive.embreex.rtcore import EmbreeDevice
from wive.scene import Scene

QUERIES = "INTERSECT", "OCCLUDED", "DISTANCE"
# The end of a ray for which none is given, embreex's own.
FAR = 1e37
# Embree's fast test excludes t = 0, its robust test does not.
ABOVE_ZERO = float(np.finfo(np.float32).tiny)


class EmbreeScene:
    """Triangle meshes, numbered from 0 in the order they are added, that answer ray queries.

    Meshes are added by `TriangleMesh` and `ElementMesh`, also after a query. Their tree is built by the next
    query.

    Attributes:
        is_committed: 1 if the tree is that of all meshes, 0 if the next query builds it.
    """

    def __init__(self, device: EmbreeDevice | None = None, robust: bool = True) -> None:
        """An empty scene.

        Arguments:
            device: for embreex's sake; nothing depends on it.
            robust: accuracy "watertight" of `wive.Scene`, else "fast".
        """
        if not isinstance(device, EmbreeDevice | None):
            raise TypeError(f"device must be an EmbreeDevice or None, got {type(device).__name__}")
        self.is_committed = 0
        self._tmin = 0.0 if robust else ABOVE_ZERO
        self._accuracy: AccuracyOption = "watertight" if robust else "fast"
        self._scene = Scene(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
        self._meshes: list[tuple[Floats, NDArray[np.int32]]] = []
        # Of the triangles of a tree, from when they are needed.
        self._normals: tuple[Scene, NDArray[np.float32]] | None = None

    @property
    def scene(self) -> Scene:
        """The `wive.Scene` over all meshes added so far, one after another."""
        if not self.is_committed:
            meshes = self._meshes.copy()
            if meshes:
                self._scene = Scene.from_meshes(meshes, accuracy=self._accuracy)
            self.is_committed = int(len(meshes) == len(self._meshes))
        return self._scene

    def add(self, vertices: Floats, triangles: NDArray[np.int32]) -> int:
        """Add a mesh of vertices (v,3) float32 and triangles (f,3) int32, both kept; returns its number."""
        self._meshes.append((vertices, triangles))
        self.is_committed = 0
        return len(self._meshes) - 1

    @overload
    def run(
        self,
        vec_origins: ArrayLike,
        vec_directions: ArrayLike,
        dists: ArrayLike | None = None,
        query: str = "INTERSECT",
        output: Literal[None, False, 0] = None,
    ) -> NDArray[Any]: ...
    @overload
    def run(
        self,
        vec_origins: ArrayLike,
        vec_directions: ArrayLike,
        dists: ArrayLike | None = None,
        query: str = "INTERSECT",
        *,
        output: Literal[True, 1],
    ) -> dict[str, NDArray[Any]]: ...
    def run(
        self,
        vec_origins: ArrayLike,
        vec_directions: ArrayLike,
        dists: ArrayLike | None = None,
        query: str = "INTERSECT",
        output: object = None,
    ) -> NDArray[Any] | dict[str, NDArray[Any]]:
        """Trace n rays on all cores.

        Arguments:
            vec_origins: (n,3) real numbers, taken as float32.
            vec_directions: (n,3), or (1,3) if all rays share it, of any length.
            dists: where rays end, in multiples of the direction's length: a number, or (n,) one per ray; None
                is 1e37. Never written to.
            query: "INTERSECT", "DISTANCE" or "OCCLUDED".
            output: return a dictionary; not with "OCCLUDED".

        Returns by query, for the closest hit of each ray:
            INTERSECT: (n,) int32, the triangle's number in its mesh, -1 on a miss.
            DISTANCE: (n,) float32, the distance in multiples of the direction's length, `dists` on a miss.
            OCCLUDED: (n,) int32, 0 if the ray hits anything, else -1.
        With `output`, by name:
            primID, geomID: (n,) int32, the triangle's number in its mesh and the mesh's; -1 on a miss.
            tfar: (n,) float32, as of DISTANCE.
            u, v: (n,) float32, the point hit is (1-u-v) v0 + u v1 + v v2; 0 on a miss.
            Ng: (n,3) float32, the normal (v1-v0) x (v2-v0), not of unit length; 0 on a miss.

        Raises ValueError or TypeError, in one line naming the argument.
        """
        arguments.choice("query", query, QUERIES)
        if output and query == "OCCLUDED":
            raise ValueError(
                "output is for queries INTERSECT and DISTANCE, got it with OCCLUDED: leave it out"
            )
        origins = arguments.vectors("vec_origins", vec_origins, FLOAT32, may_be_one=False)
        directions = arguments.vectors("vec_directions", vec_directions, FLOAT32, may_be_one=False)
        count = len(origins)
        if len(directions) not in (1, count):
            raise ValueError(
                f"vec_directions must have shape ({count}, 3), one per origin, or (1, 3), "
                f"got {directions.shape}"
            )
        if len(directions) == 1:
            directions = directions[0]
        ends = arguments.limits("dists", FAR if dists is None else dists, count)
        tmax = ends if ends.size == count else ends[0]
        scene = self.scene
        if query == "OCCLUDED":
            return scene.occluded(origins, directions, self._tmin, tmax).astype(np.int32) - np.int32(1)
        hits = scene.intersect(origins, directions, self._tmin, tmax)
        if query == "DISTANCE" and not output:
            return np.where(hits.mask, hits.t, ends)
        if not output:
            return hits.geom_prim
        u, v = np.where(hits.mask, hits.uv.T, np.float32(0))
        tfar = np.where(hits.mask, hits.t, ends)
        kept = self._normals
        if kept is None or kept[0] is not scene:
            kept = self._normals = scene, _normals(scene)
        normals = kept[1][hits.prim]
        return {"u": u, "v": v, "Ng": normals, "tfar": tfar, "primID": hits.geom_prim, "geomID": hits.geom}


def _normals(scene: Scene) -> NDArray[np.float32]:
    """(f+1,3) normals of the triangles, twice their area long, computed in float64; 0 for number -1."""
    corners = scene.vertices.astype(np.float64)[scene.faces]
    normals = np.zeros((len(scene) + 1, 3), np.float32)
    normals[:-1] = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals
