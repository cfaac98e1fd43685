"""Warp's own closest-hit query, `wp.mesh_query_ray`, over a batch of rays."""

# mypy: disable-error-code="untyped-decorator"

from typing import Any

import warp as wp

from bench.support.scenes import Mesh

wp.set_module_options({"enable_backward": False})


class MeshQuery:
    """A mesh with Warp's best tree, on one device."""

    def __init__(self, mesh: Mesh, device: str) -> None:
        """Build by the surface-area heuristic: the default on CUDA builds faster and traces slower."""
        self.device = device
        self.mesh = wp.Mesh(
            points=wp.array(mesh.vertices, dtype=wp.vec3, device=device),
            indices=wp.array(mesh.faces.ravel(), dtype=wp.int32, device=device),
            bvh_constructor="sah",
        )

    def outputs(self, count: int) -> tuple[Any, Any, Any]:
        """New arrays for t, prim and uv."""
        t = wp.empty(count, dtype=wp.float32, device=self.device)
        prim = wp.empty(count, dtype=wp.int32, device=self.device)
        return t, prim, wp.empty(count, dtype=wp.vec2, device=self.device)

    def launch(self, origins: Any, directions: Any, t: Any, prim: Any, uv: Any) -> None:
        """Closest hits of rays (n,) vec3 into t, prim and uv; t inf and prim -1 on a miss."""
        inputs = [self.mesh.id, origins, directions]
        wp.launch(_closest, len(origins), inputs, [t, prim, uv], device=self.device)


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
