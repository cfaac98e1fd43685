"""All hits on a Warp device: what is not an array of theirs already is computed there."""

# mypy: disable-error-code="untyped-decorator"

from dataclasses import dataclass
from typing import Any

import warp as wp

from wive.all_hits import row_of
from wive.warp_kernels.scene.hits import WarpHits

wp.set_module_options({"enable_backward": False})


@dataclass(frozen=True, eq=False, repr=False)
class WarpAllHits(WarpHits):
    """What `wive.AllHits` holds, as Warp arrays: offsets (n+1,) int64, t and prim (h,), uv (h,) vec2."""

    offsets: Any

    @property
    def counts(self) -> Any:
        """(n,) int32."""
        counts = wp.empty(len(self), dtype=wp.int32, device=self.offsets.device)
        wp.launch(_counts, len(counts), [self.offsets], [counts], device=counts.device)
        return counts

    @property
    def ray(self) -> Any:
        """(h,) int64."""
        ray = wp.empty(len(self.t), dtype=wp.int64, device=self.offsets.device)
        wp.launch(_rays, len(self), [self.offsets], [ray], device=ray.device)
        return ray

    def __len__(self) -> int:
        """Number of rays."""
        return len(self.offsets) - 1

    def __getitem__(self, i: int) -> "WarpAllHits":
        """The hits of ray i; waits for the device."""
        row = row_of(i, len(self))
        first, last = (int(offset) for offset in self.offsets[row : row + 2].numpy())
        t, prim, uv = (_part(array, first, last) for array in (self.t, self.prim, self.uv))
        offsets = wp.array([0, last - first], dtype=wp.int64, device=self.offsets.device)
        return WarpAllHits(t, prim, uv, self.vertices, self.faces, self.mesh_on_device, offsets)


def _part(array: Any, first: int, last: int) -> Any:
    """Rows of an array, over the same memory; Warp refuses slices of no rows."""
    return array[first:last] if last > first else wp.empty(0, dtype=array.dtype, device=array.device)


@wp.kernel
def _counts(offsets: wp.array[wp.int64], counts: wp.array[wp.int32]) -> None:
    i = wp.tid()
    counts[i] = wp.int32(offsets[i + 1] - offsets[i])


@wp.kernel
def _rays(offsets: wp.array[wp.int64], ray: wp.array[wp.int64]) -> None:
    i = wp.tid()
    for row in range(wp.int32(offsets[i]), wp.int32(offsets[i + 1])):
        ray[row] = wp.int64(i)
