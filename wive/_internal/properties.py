"""What a scene tells of itself."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.precision import Floats, Precision, Real

if TYPE_CHECKING:
    from wive.warp_kernels import Tree
    from wive.warp_kernels.scene.tracer import WarpTracer


class SceneProperties:
    """The part of `wive.Scene` that asks for no rays."""

    _bvh: _cpu.Bvh
    _faces: NDArray[np.int32]
    _real: Real
    _backend: str
    _device: str | None
    _warp: "WarpTracer | None"

    @property
    def vertices(self) -> Floats:
        """(v,3) float32 or float64 as `precision` says, read-only."""
        return self._bvh.vertices

    @property
    def faces(self) -> NDArray[np.int32]:
        """(f,3) int32, read-only."""
        return self._faces

    @property
    def bounds(self) -> Floats:
        """(2,3) lowest and highest corner of the triangles that can be hit; inf, -inf without any.

        float32 or float64 as `precision` says.
        """
        return self._bvh.bounds

    @property
    def memory(self) -> int:
        """Bytes of the tree: nodes and leaves."""
        return self._bvh.memory

    @property
    def backend(self) -> str:
        """The backend that traces: never "auto"."""
        return self._backend

    @property
    def device(self) -> str | None:
        """The Warp device that traces, such as "cuda:0"; None for CPU backends."""
        return self._device

    @property
    def tree(self) -> "Tree":
        """The tree on the scene's Warp device, for `wive.warp_kernels`; ValueError for CPU backends."""
        if self._warp is None:
            raise ValueError(
                f"tree is for scenes with backend 'warp', this one has {self._backend!r}: "
                "make it with device='cpu' or device='cuda:0'"
            )
        return self._warp.tree

    @property
    def accuracy(self) -> str:
        """ "watertight", "fast" or "exact"."""
        return self._bvh.accuracy

    @property
    def precision(self) -> Precision:
        """ "float32" or "float64": the dtype of vertices, bounds, t and uv, and what rays are taken in."""
        return self._real.name

    @property
    def nodes(self) -> str:
        """ "float32" or "compressed"."""
        return self._bvh.node_form

    def __len__(self) -> int:
        """Number of triangles."""
        return len(self._faces)
