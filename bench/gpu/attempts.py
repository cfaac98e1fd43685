"""The attempts of section `streams`: each traces the same rays its own way and counts the wrong numbers.

Where a stream has to wait for another, a kernel that spins keeps the rays from being written for a tenth of a
second: a query that does not wait reads what was there before.
"""

# mypy: disable-error-code="import-not-found, no-untyped-def, untyped-decorator, valid-type"

import contextlib
import os
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

import wive
from bench.gpu.rays import hard_rays
from bench.gpu.session import differing

SEED = 9
SPINNING_CYCLES = 200_000_000
UP = (0.0, 0.0, 1.0)
REFITS = 20
SHIFT = np.float32(0.25)  # how far a refit moves the mesh

Wrong = dict[str, int]  # answers that are wrong, and in how many numbers


class Case(NamedTuple):
    """A mesh, rays and a device."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    device: str
    origins: NDArray[np.float32]
    directions: NDArray[np.float32]

    @property
    def scene(self) -> Any:
        """A new scene on the device, whose hits are of the library that the rays are of."""
        return wive.Scene(self.vertices, self.faces, device=self.device)

    @property
    def core(self) -> wive.Scene:
        """A new scene of the C++ core."""
        return wive.Scene(self.vertices, self.faces)

    @property
    def right(self) -> wive.Hits:
        """The core's hits."""
        return self.core.intersect(self.origins, self.directions)


class Attempt(NamedTuple):
    """One way to trace."""

    work: Callable[[Case], Wrong]
    needs_gpu: bool


def hard_case(vertices: NDArray[np.float32], faces: NDArray[np.int32], device: str, count: int) -> Case:
    """The case that all attempts trace."""
    origins, directions = hard_rays(vertices, faces, count, SEED)
    return Case(vertices, faces, device, origins.astype(np.float32), directions.astype(np.float32))


def compared(found: dict[str, Any], right: dict[str, Any]) -> Wrong:
    """The answers found that have wrong numbers."""
    counts = {key: differing(value, right[key]) for key, value in found.items()}
    return {key: count for key, count in counts.items() if count}


def truth(case: Case) -> dict[str, Any]:
    """Every answer of the core."""
    hits = case.right
    names = ("t", "prim", "mask", "error_bound")
    return {name: getattr(hits, name) for name in names} | {
        "points": hits.points(),
        "normals": hits.normals(),
        "spawn": hits.spawn(UP),
        "any": case.core.occluded(case.origins, case.directions),
        "count": case.core.count(case.origins, case.directions),
    }


def torch_tensors(case: Case, on_side_stream: bool = False) -> Wrong:
    """Every answer, read on the stream that torch is on, as a user would."""
    import torch

    rays = [torch.from_numpy(rows).to(case.device) for rows in (case.origins, case.directions)]
    on_gpu = case.device != "cpu"
    stream: Any = contextlib.nullcontext()
    if on_gpu:
        torch.cuda.synchronize()
    if on_side_stream:
        stream = torch.cuda.stream(torch.cuda.Stream(case.device))
    scene = case.scene
    with stream:
        origins, directions = torch.full_like(rays[0], 7.0), torch.zeros_like(rays[1])
        if on_gpu:
            torch.cuda._sleep(SPINNING_CYCLES)
        origins.copy_(rays[0])
        directions.copy_(rays[1])
        hits = scene.intersect(origins, directions)
        answers = {name: getattr(hits, name) for name in ("mask", "error_bound", "t", "prim")}
        answers |= {"points": hits.points(), "normals": hits.normals(), "spawn": hits.spawn(UP)}
        answers |= {"any": scene.occluded(origins, directions), "count": scene.count(origins, directions)}
        copies = {name: answer.clone() for name, answer in answers.items()}
        if on_gpu:
            torch.cuda.current_stream().synchronize()
    return compared({name: copy.cpu().numpy() for name, copy in copies.items()}, truth(case))


def torch_refits(case: Case) -> Wrong:
    """Refits and queries in turn on a side stream, without a wait between."""
    import torch

    places = case.vertices, case.vertices + SHIFT
    right = [wive.Scene(place, case.faces).intersect(case.origins, case.directions).prim for place in places]
    rays = [torch.from_numpy(rows).to(case.device) for rows in (case.origins, case.directions)]
    scene = case.scene
    scene.intersect(*rays)
    torch.cuda.synchronize()
    wrong = 0
    with torch.cuda.stream(torch.cuda.Stream(case.device)):
        for number in range(1, REFITS + 1):
            scene.refit(places[number % 2])
            prim = scene.intersect(*rays).prim.clone()
            torch.cuda.current_stream().synchronize()
            wrong += differing(prim.cpu().numpy(), right[number % 2])
    return {"prim": wrong} if wrong else {}


def torch_graph(case: Case) -> Wrong:
    """A graph that torch captures, replayed over other rays than it was captured with."""
    import torch

    shape = case.origins.shape
    origins, directions = torch.zeros(shape, device=case.device), torch.ones(shape, device=case.device)
    scene = case.scene
    _ = scene.intersect(origins, directions).mask  # compiled outside the capture
    torch.cuda.synchronize()
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        hits = scene.intersect(origins, directions)
        answers = {"t": hits.t, "mask": hits.mask}
    origins.copy_(torch.from_numpy(case.origins))
    directions.copy_(torch.from_numpy(case.directions))
    graph.replay()
    torch.cuda.synchronize()
    return compared({name: answer.cpu().numpy() for name, answer in answers.items()}, truth(case))


def warp_graph(case: Case) -> Wrong:
    """A graph that Warp captures, replayed over other rays than it was captured with."""
    count = len(case.origins)
    origins = wp.zeros(count, dtype=wp.vec3, device=case.device)
    directions = wp.full(count, wp.vec3(1.0), dtype=wp.vec3, device=case.device)
    scene = case.scene
    _ = scene.intersect(origins, directions).mask, scene.count(origins, directions)  # compiled before
    with wp.ScopedCapture(device=case.device) as capture:
        hits = scene.intersect(origins, directions)
        answers = {"t": hits.t, "mask": hits.mask, "count": scene.count(origins, directions)}
    origins.assign(case.origins)
    directions.assign(case.directions)
    wp.capture_launch(capture.graph)
    return compared({name: answer.numpy() for name, answer in answers.items()}, truth(case))


def cupy_arrays(case: Case) -> Wrong:
    """CuPy's arrays on a stream of its own."""
    import cupy

    scene = case.scene
    with cupy.cuda.Stream(non_blocking=True) as stream:
        origins, directions = cupy.asarray(case.origins), cupy.asarray(case.directions)
        hits = scene.intersect(origins, directions)
        answers = {name: getattr(hits, name).copy() for name in ("t", "prim", "mask")}
        stream.synchronize()
    return compared({name: answer.get() for name, answer in answers.items()}, truth(case))


def jax_arrays(case: Case) -> Wrong:
    """JAX's arrays."""
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
    import jax

    place = jax.devices("gpu" if case.device != "cpu" else "cpu")[0]
    rays = [jax.device_put(rows, place) for rows in (case.origins, case.directions)]
    hits = case.scene.intersect(*rays)
    return compared({name: np.asarray(getattr(hits, name)) for name in ("t", "prim", "mask")}, truth(case))


class OnlyInterface:
    """An array known only by its __cuda_array_interface__, which names the stream that writes it."""

    def __init__(self, array: Any, stream: int) -> None:
        """Keeps the array alive."""
        self.array = array
        self.__cuda_array_interface__ = {**array.__cuda_array_interface__, "version": 3, "stream": stream}


def interface_arrays(case: Case) -> Wrong:
    """Arrays with nothing but __cuda_array_interface__, still being written on a side stream."""
    import torch

    side = torch.cuda.Stream(case.device)
    shape = case.origins.shape
    with torch.cuda.stream(side):
        origins, directions = torch.zeros(shape, device=case.device), torch.ones(shape, device=case.device)
        torch.cuda._sleep(SPINNING_CYCLES)
        origins.copy_(torch.from_numpy(case.origins))
        directions.copy_(torch.from_numpy(case.directions))
    rays = [OnlyInterface(rows, side.cuda_stream) for rows in (origins, directions)]
    hits = case.scene.intersect(*rays)
    return compared({name: getattr(hits, name).numpy() for name in ("t", "prim")}, truth(case))


def own_kernel(case: Case) -> Wrong:
    """A user's kernel that calls `closest_hit`, compiled with Warp's default options."""
    from wive import warp_kernels

    handle_type, closest_hit = warp_kernels.Bvh, warp_kernels.closest_hit

    @wp.kernel(module="unique", enable_backward=False)
    def cast(
        bvh: handle_type,
        origins: wp.array(dtype=wp.vec3),
        directions: wp.array(dtype=wp.vec3),
        t: wp.array(dtype=wp.float32),
        prim: wp.array(dtype=wp.int32),
    ):
        i = wp.tid()
        hit = closest_hit(bvh, origins[i], directions[i], 0.0, wp.inf)
        t[i] = hit.t
        prim[i] = hit.prim

    count, scene = len(case.origins), case.scene
    rays = [wp.array(rows, dtype=wp.vec3, device=case.device) for rows in (case.origins, case.directions)]
    t = wp.zeros(count, dtype=wp.float32, device=case.device)
    prim = wp.zeros(count, dtype=wp.int32, device=case.device)
    wp.launch(cast, count, [scene.tree.handle, *rays, t, prim], device=case.device)
    return compared({"t": t.numpy(), "prim": prim.numpy()}, truth(case))


def torch_side_stream(case: Case) -> Wrong:
    """`torch_tensors` on a stream beside the default one."""
    return torch_tensors(case, on_side_stream=True)


ATTEMPTS = {
    "torch, default stream": Attempt(torch_tensors, needs_gpu=False),
    "torch, side stream": Attempt(torch_side_stream, needs_gpu=True),
    "torch, refit and query on a side stream": Attempt(torch_refits, needs_gpu=True),
    "torch graph": Attempt(torch_graph, needs_gpu=True),
    "warp graph": Attempt(warp_graph, needs_gpu=True),
    "cupy, side stream": Attempt(cupy_arrays, needs_gpu=True),
    "jax": Attempt(jax_arrays, needs_gpu=False),
    "__cuda_array_interface__, side stream": Attempt(interface_arrays, needs_gpu=True),
    "own kernel": Attempt(own_kernel, needs_gpu=False),
}
