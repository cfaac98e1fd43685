"""Warp's own queries, `wp.mesh_query_ray` and `wp.mesh_query_ray_anyhit`, over a batch of rays."""

# mypy: disable-error-code="untyped-decorator"

from typing import Any

import warp as wp

from bench.support.scenes import Mesh

wp.set_module_options({"enable_backward": False})

BUILDERS = ("sah", "cubql")  # the trees that trace fastest
BLOCK = 256  # threads per block, Warp's default


class MeshQuery:
    """A mesh with one of Warp's trees, on one device."""

    def __init__(self, mesh: Mesh, device: str, builder: str = "sah") -> None:
        """Builds by the surface-area heuristic: Warp's default on CUDA builds faster and traces slower."""
        self.device, self.builder = device, builder
        self.mesh = wp.Mesh(
            points=wp.array(mesh.vertices, dtype=wp.vec3, device=device),
            indices=wp.array(mesh.faces.ravel(), dtype=wp.int32, device=device),
            bvh_constructor=builder,
        )

    def outputs(self, count: int) -> tuple[Any, Any, Any]:
        """New arrays for t, prim and uv."""
        t = wp.empty(count, dtype=wp.float32, device=self.device)
        prim = wp.empty(count, dtype=wp.int32, device=self.device)
        return t, prim, wp.empty(count, dtype=wp.vec2, device=self.device)

    def launch(
        self, origins: Any, directions: Any, t: Any, prim: Any, uv: Any, block_dim: int = BLOCK
    ) -> None:
        """Closest hits of rays (n,) vec3 into t, prim and uv; t inf and prim -1 on a miss."""
        inputs = [self.mesh.id, origins, directions]
        wp.launch(_closest, len(origins), inputs, [t, prim, uv], device=self.device, block_dim=block_dim)

    def launch_any(self, origins: Any, directions: Any, occluded: Any) -> None:
        """Whether rays (n,) vec3 hit anything, into occluded (n,) bool."""
        wp.launch(_any, len(origins), [self.mesh.id, origins, directions], [occluded], device=self.device)


@wp.kernel
def _closest(
    mesh: wp.uint64,
    origins: wp.array[wp.vec3],
    directions: wp.array[wp.vec3],
    t: wp.array[wp.float32],
    prim: wp.array[wp.int32],
    uv: wp.array[wp.vec2],
) -> None:
    i = wp.tid()
    hit = wp.mesh_query_ray(mesh, origins[i], directions[i], wp.inf)
    t[i] = wp.where(hit.result, hit.t, wp.inf)
    prim[i] = wp.where(hit.result, hit.face, -1)
    uv[i] = wp.vec2(hit.u, hit.v)


@wp.kernel
def _any(
    mesh: wp.uint64,
    origins: wp.array[wp.vec3],
    directions: wp.array[wp.vec3],
    occluded: wp.array[wp.bool],
) -> None:
    i = wp.tid()
    occluded[i] = wp.mesh_query_ray_anyhit(mesh, origins[i], directions[i], wp.inf)
