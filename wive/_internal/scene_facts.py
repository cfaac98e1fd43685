"""What a scene tells of itself: its mesh, its options, its size."""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.precision import Floats, Precision, Real
from wive._internal.tracer import Tracer
from wive.geoms import Geoms, one_geom

if TYPE_CHECKING:
    from wive.warp_kernels import Tree


class SceneFacts:
    """Facts about what `_tracer` traces; `_real` is the precision of its numbers."""

    _tracer: Tracer
    _faces: NDArray[np.int32]
    _real: Real

    @property
    def vertices(self) -> Floats:
        """(v,3) float32 or float64 as `precision` says, read-only."""
        return self._bvh.vertices

    @property
    def faces(self) -> NDArray[np.int32]:
        """(f,3) int32, read-only."""
        return self._faces

    @property
    def geoms(self) -> Geoms:
        """The meshes of `from_meshes`: the first row of each in `faces` and `vertices`; else one mesh."""
        return self._tracer.geoms or one_geom(len(self._faces), len(self.vertices))

    @property
    def bounds(self) -> Floats:
        """(2,3) lowest and highest corner of the triangles that can be hit; inf, -inf if there are none.

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
        return self._tracer.backend

    @property
    def device(self) -> str | None:
        """The Warp device that traces, such as "cuda:0"; None for CPU backends."""
        return self._tracer.device

    @property
    def tree(self) -> Tree:
        """The tree on the scene's Warp device, for `wive.warp_kernels`; ValueError for CPU backends."""
        return self._tracer.tree

    def __ctype__(self) -> NoReturn:
        """Raise TypeError: Warp asks arguments of kernels for this, and kernels take the handle."""
        raise TypeError("kernels take the handle of a tree, got a Scene: pass scene.tree.handle")

    @property
    def accuracy(self) -> str:
        """ "watertight", "fast" or "exact"."""
        return self._bvh.accuracy

    @property
    def precision(self) -> Precision:
        """ "float32" or "float64": the dtype of vertices, rays, bounds, t and uv."""
        return self._real.name

    @property
    def nodes(self) -> str:
        """ "float32" or "compressed"."""
        return self._bvh.node_form

    def __len__(self) -> int:
        """Number of triangles."""
        return len(self._faces)

    def __repr__(self) -> str:
        """Size and options, and where the tree is stored if it is."""
        device = "" if self.device is None else f", device={self.device!r}"
        options = (
            f"backend={self.backend!r}{device}, accuracy={self.accuracy!r}, precision={self.precision!r}"
        )
        geoms = self._tracer.geoms
        several = "" if geoms is None else f" in {len(geoms)} meshes"
        source = self._bvh.source
        stored = "" if source is None else f", {source.place.described}"
        return f"Scene({len(self)} triangles{several}, {options}{stored})"

    @property
    def _bvh(self) -> _cpu.Bvh:
        return self._tracer.bvh
