"""Closest hits for PyTorch's autograd: distances and points with gradients to rays and vertices.

Which triangle a ray hits does not change smoothly with anything, so queries carry no gradient. Here a query
finds the triangle, and torch computes where the ray meets its plane.

>>> import wive.torch
>>> t, points, hits = wive.torch.intersect(scene, origins, directions, vertices=vertices)
>>> (t - measured)[hits.mask].square().sum().backward()   # origins.grad, directions.grad, vertices.grad
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

try:
    import torch
except ImportError as error:
    raise ImportError(f"wive.torch needs PyTorch ({error}): pip install torch") from error

from wive._internal.options import LanesOption
from wive.hits import Hits
from wive.scene import Scene


class DifferentiableHits(NamedTuple):
    """The closest hit of each of n rays, or of rays of any other leading shape in place of (n,).

    Attributes:
        t: (n,) distance in multiples of the direction's length, with gradients; inf on a miss.
        points: (n,3) hit points, with gradients; NaN on a miss.
        hits: the scene's own `Hits`, without gradients: prim, uv, mask, normals and the like.
    """

    t: torch.Tensor
    points: torch.Tensor
    hits: Hits


def intersect(
    scene: Scene,
    origins: torch.Tensor,
    directions: torch.Tensor,
    tmin: float | torch.Tensor = 0.0,
    tmax: float | torch.Tensor = math.inf,
    *,
    vertices: torch.Tensor | None = None,
    threads: int | None = None,
    in_flight: int | None = None,
    lanes: LanesOption = "auto",
) -> DifferentiableHits:
    """The closest hits, with gradients of t and the points to origins, directions and vertices.

    Gradients are those of the triangle that is hit: they do not include the jump of t when a ray moves past
    an edge, and those of misses are zero. They may be differentiated again. t is computed from the triangle
    in the dtype of the rays and vertices, so its last digits may differ from those of `hits.t`.

    Arguments:
        scene: any scene; one on a Warp device takes tensors on that device and of its dtype.
        origins, directions, tmin, tmax, threads, in_flight, lanes: as `Scene.intersect` takes them.
        vertices: (v,3) the vertices of the scene as the tensor that gets gradients, on the rays' device;
            None takes the scene's own. Rays meet the planes that these give, so they should be those that the
            scene was made of or refitted to.

    Raises ValueError or TypeError as `Scene.intersect`, if rays or vertices are no tensors, and if `vertices`
    does not fit the scene and rays.
    """
    _expect_tensors(origins=origins, directions=directions, vertices=vertices)
    limits = (limit.detach() if isinstance(limit, torch.Tensor) else limit for limit in (tmin, tmax))
    options: dict[str, Any] = {"threads": threads, "in_flight": in_flight, "lanes": lanes}
    hits: Any = scene.intersect(origins.detach(), directions.detach(), *limits, **options)
    if len(scene) == 0:
        return DifferentiableHits(hits.t, hits.points().to(hits.t.dtype), hits)
    v0, v1, v2 = _corners(scene, hits.prim, vertices).unbind(dim=-2)
    # Misses are kept away from the arithmetic: zero times the gradient of NaN would be NaN.
    mask = hits.mask
    origin, direction = (torch.where(mask[..., None], rays, 0.0) for rays in (origins, directions))
    normal = torch.linalg.cross(v1 - v0, v2 - v0)
    along = torch.where(mask, (normal * direction).sum(dim=-1), 1.0)
    t = (normal * (v0 - origin)).sum(dim=-1) / along
    points = origin + t[..., None] * direction
    t, points = torch.where(mask, t, math.inf), torch.where(mask[..., None], points, math.nan)
    return DifferentiableHits(t, points, hits)


def _corners(scene: Scene, prim: torch.Tensor, vertices: torch.Tensor | None) -> torch.Tensor:
    """(n,3,3) the corners of triangles prim (n,), as rows; of the first triangle for -1."""
    if vertices is not None:
        _expect_fitting(scene, prim, vertices)
    first = prim.clamp(min=0)
    if scene.device is None:
        faces = scene.faces[first.numpy()]
        if vertices is None:
            return torch.from_numpy(scene.vertices[faces])
        return vertices[torch.from_numpy(faces)]
    import warp as wp

    of_scene, faces = (wp.to_torch(array) for array in scene._tracer.mesh)  # type: ignore[attr-defined]
    return (of_scene if vertices is None else vertices)[faces[first]]


def _expect_tensors(**values: torch.Tensor | None) -> None:
    for name, value in values.items():
        if not (isinstance(value, torch.Tensor) or (value is None and name == "vertices")):
            kind = type(value).__name__
            raise TypeError(f"{name} must be a torch.Tensor, got {kind}: torch.as_tensor makes one")


def _expect_fitting(scene: Scene, prim: torch.Tensor, vertices: torch.Tensor) -> None:
    expected = (len(scene.vertices), 3)
    if tuple(vertices.shape) != expected:
        raise ValueError(f"vertices must have shape {expected}, as the scene's, got {tuple(vertices.shape)}")
    if vertices.device != prim.device:
        raise ValueError(f"vertices must be on the device of the rays, {prim.device}, got {vertices.device}")
    if not vertices.is_floating_point():
        raise TypeError(f"vertices must be of a floating-point dtype, got {vertices.dtype}")
