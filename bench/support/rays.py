"""The rays that benches trace: recorded once per mesh, so that every side and run traces the same arrays."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import cache_folder
from bench.support.scenes import Camera, Mesh
from wive._internal.files import atomic_write

GENERATOR_VERSION = 1  # part of the cache's key: raise it if the rays change

PRIMARY_SIDE = 512  # pixels of the square picture: 262 k rays
DIFFUSE_SIDE = 362  # pixels of the square picture that paths start from: up to 8 x 131 k rays
BOUNCES = 8
RANDOM_COUNT = 500_000
SHADOW_PER_HIT = 2
# In diagonals of the bounding box:
SHADOW_TMAX = 0.1
SPAWN_OFFSET = 1e-5  # distance of new origins from the surface

Array = NDArray[np.float32]
# Closest hits: origins, directions -> t (n,), inf on a miss, and unit normals (n,3) of the triangles hit.
Tracer = Callable[[Array, Array], tuple[NDArray[np.floating], NDArray[np.floating]]]


@dataclass(frozen=True)
class Rays:
    """One set: (n,3) origins and unit directions, one tmin and tmax for all; float32 and C-contiguous."""

    kind: str
    origins: Array
    directions: Array
    tmin: Array
    tmax: Array

    def __len__(self) -> int:
        """Number of rays."""
        return len(self.origins)

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """The arguments of both sides: origins, directions, tmin, tmax."""
        return self.origins, self.directions, self.tmin, self.tmax

    @property
    def any_hit(self) -> bool:
        """Whether the set is for any-hit queries."""
        return self.kind == "shadow"

    def thinned(self, count: int, run: int = 256) -> "Rays":
        """About `count` of the rays: evenly spread runs of neighbours, to keep the set's coherence."""
        if len(self) <= count:
            return self
        starts = np.linspace(0, len(self) - run, max(1, count // run)).astype(np.int64)
        chosen = (starts[:, None] + np.arange(run)).ravel()
        return Rays(self.kind, self.origins[chosen], self.directions[chosen], self.tmin, self.tmax)


KINDS = ("primary", "diffuse", "shadow", "random")


def camera_rays(camera: Camera, side: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """One jittered ray per pixel of a square picture, row by row from the top left."""
    eye, target, up = (np.array(vector, np.float64) for vector in (camera.eye, camera.target, camera.up))
    forward = _unit(target - eye)
    right = _unit(np.cross(forward, up))
    above = np.cross(right, forward)
    rows, columns = np.divmod(np.arange(side * side), side)
    jitter = rng.random((2, side * side))
    half = np.tan(np.radians(camera.fov) / 2)
    x = (2 * (columns + jitter[0]) / side - 1) * half
    y = (1 - 2 * (rows + jitter[1]) / side) * half
    directions = _unit(forward + x[:, None] * right + y[:, None] * above)
    return _float32(np.broadcast_to(eye, directions.shape)), _float32(directions)


def bounce(
    origins: Array,
    directions: Array,
    t: NDArray[np.floating],
    normals: NDArray[np.floating],
    offset: float,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Cosine-distributed rays from the hits, on the side that the given rays came from; misses drop out."""
    hit = np.isfinite(t)
    arriving = directions[hit].astype(np.float64)
    points = origins[hit] + t[hit, None].astype(np.float64) * arriving
    normal = normals[hit].astype(np.float64)
    normal *= np.where(np.einsum("ij,ij->i", normal, arriving) > 0, -1.0, 1.0)[:, None]
    # Points of the unit sphere around the normal's tip are cosine-distributed; 0.999 keeps them from 0.
    leaving = _unit(normal + 0.999 * _unit(rng.normal(size=normal.shape)))
    return _float32(points + offset * normal), _float32(leaving)


def random_rays(mesh: Mesh, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Rays from random points of the bounding box towards random points of it."""
    lowest, highest = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    start, end = rng.uniform(lowest, highest, (2, count, 3))
    return _float32(start), _float32(_unit(end - start))


def generate(mesh: Mesh, trace: Tracer) -> dict[str, Rays]:
    """The sets of rays for a mesh, by kind."""
    seed = int.from_bytes(hashlib.sha256(mesh.name.encode()).digest()[:8], "little")
    rng = np.random.default_rng([seed, GENERATOR_VERSION])
    offset = SPAWN_OFFSET * mesh.diagonal
    tmax = {"shadow": SHADOW_TMAX * mesh.diagonal}
    sets = {"primary": camera_rays(mesh.camera, PRIMARY_SIDE, rng)}

    seen = [(*sets["primary"], *trace(*sets["primary"]))] * SHADOW_PER_HIT
    sets["shadow"] = _joined([bounce(*hits, offset, rng) for hits in seen])

    paths = camera_rays(mesh.camera, DIFFUSE_SIDE, rng)
    depths = []
    for _ in range(BOUNCES):
        paths = bounce(*paths, *trace(*paths), offset, rng)
        depths.append(paths)
    sets["diffuse"] = _joined(depths)
    sets["random"] = random_rays(mesh, RANDOM_COUNT, rng)
    return {
        kind: Rays(kind, *sets[kind], np.zeros(1, np.float32), np.full(1, tmax.get(kind, np.inf), np.float32))
        for kind in KINDS
    }


def recorded_rays(mesh: Mesh, trace: Tracer | None = None) -> dict[str, Rays]:
    """The mesh's rays by kind, from the cache; if missing, generated (with wive's hits) and stored there."""
    path = _cache_path(mesh)
    if not path.exists():
        sets = generate(mesh, trace or wive_tracer(mesh))
        arrays = {
            f"{kind}_{name}": array
            for kind, rays in sets.items()
            for name, array in zip(("origins", "directions", "tmin", "tmax"), rays.arrays, strict=True)
        }
        with atomic_write(path) as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
    with np.load(path) as stored:
        return {
            kind: Rays(
                kind, *(stored[f"{kind}_{name}"] for name in ("origins", "directions", "tmin", "tmax"))
            )
            for kind in KINDS
        }


def wive_tracer(mesh: Mesh) -> Tracer:
    """Closest hits and normals by wive."""
    import wive

    scene = wive.Scene(mesh.vertices, mesh.faces)

    def trace(origins: Array, directions: Array) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        hits = scene.intersect(origins, directions)
        return hits.t, hits.normals()

    return trace


def _cache_path(mesh: Mesh) -> Path:
    content = hashlib.sha256(mesh.vertices.tobytes())
    content.update(mesh.faces.tobytes())
    content.update(repr(mesh.camera).encode())
    return cache_folder() / f"rays-{mesh.name}-v{GENERATOR_VERSION}-{content.hexdigest()[:12]}.npz"


def _joined(parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    return np.concatenate([origins for origins, _ in parts]), np.concatenate(
        [directions for _, directions in parts]
    )


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _float32(array: NDArray[np.floating]) -> Array:
    return np.ascontiguousarray(array, dtype=np.float32)
