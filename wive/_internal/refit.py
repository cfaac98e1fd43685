"""Moving a scene's vertices without building its tree anew."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu
from wive._internal import arguments
from wive._internal.arrays import host_array
from wive._internal.precision import Floats, Real

if TYPE_CHECKING:
    from wive.warp_kernels.scene.tracer import WarpTracer


class Refittable:
    """What `wive.Scene` needs to follow a mesh that moves."""

    _bvh: _cpu.Bvh
    _warp: "WarpTracer | None"
    _faces: NDArray[np.int32]
    _real: Real

    @property
    def _vertices(self) -> Floats:
        return self._bvh.vertices

    def refit(self, vertices: ArrayLike) -> None:
        """Move the vertices: new positions, the same faces.

        The tree keeps its shape and gets new boxes, in a sixth of the time that building takes. Hits are
        those of a scene made anew, bit for bit; only their speed depends on how well the old shape suits the
        new positions. It does where the mesh bends or moves as a whole. Where neighbours part, rays take more
        steps with every refit, and a new `Scene` is worth its price. Triangles that lose their area are no
        longer hit; where one that had none gains some, the tree is built anew, and so are compressed trees.

        Queries that run in other threads meanwhile finish on the old positions. So does a tree for
        `wive.warp_kernels` that was taken from `tree` before: take it again. Of two refits at once the one
        that ends last counts.

        Arguments:
            vertices: (v,3) real numbers, as many as before, used in the scene's precision. A C-contiguous
                array of that dtype is kept, not copied, and may be the scene's own, changed in place; points
                and normals of earlier hits follow it then.

        Raises ValueError or TypeError as construction does, and leaves the scene as it was.
        """
        points = arguments.moved_vertices(host_array("vertices", vertices), len(self._vertices), self._real)
        bvh = self._bvh.refitted(arguments.read_only(points))
        if self._warp is not None:
            self._warp = type(self._warp)(bvh, bvh.vertices, self._faces, self._warp.device)
        self._bvh = bvh
