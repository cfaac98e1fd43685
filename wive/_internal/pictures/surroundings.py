"""What surrounds an eye: a room, or the open; and whether the sky lights what it sees."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wive._internal.pictures.sampling import cosine_directions, pcg4d, to_unit
from wive._internal.pictures.shades import dots
from wive.scene import Scene

Float64 = NDArray[np.float64]

# An eye is inside if less than this share of all directions misses.
OPEN_SHARE = 0.25
SPHERE_DIRECTIONS, ENCLOSING_DIRECTIONS = 256, 48
# Of paths that hit something: if more than this share stay in the scene, it is dark.
SUNLESS = 0.98
# Paths from a square of so many pixels.
SIDE = 24


class Sight:
    """A scene, and its queries on so many threads."""

    def __init__(self, scene: Scene, threads: int | None) -> None:
        """None is every core."""
        self.scene = scene
        self.intersect = partial(scene.intersect, threads=threads)
        self.occluded = partial(scene.occluded, threads=threads)


def stands_inside(sight: Sight, eye: Float64) -> tuple[bool, float]:
    """Whether hardly any direction from the eye leaves the scene, and the mean distance to what is hit."""
    hits = sight.intersect(eye, on_sphere(SPHERE_DIRECTIONS))
    distances = np.asarray(hits.t, np.float64)[hits.mask]
    missed = 1 - len(distances) / SPHERE_DIRECTIONS
    return missed < OPEN_SHARE, float(distances.mean()) if len(distances) else np.inf


def enclosed(sight: Sight, eyes: Float64) -> NDArray[np.bool_]:
    """Which eyes hardly see the sky, as `stands_inside` judges it with fewer directions."""
    directions = on_sphere(ENCLOSING_DIRECTIONS)
    shape = (len(eyes), len(directions), 3)
    real = sight.scene.vertices.dtype
    origins = np.broadcast_to(eyes[:, None], shape).astype(real)
    return np.asarray(
        (~sight.occluded(origins, np.broadcast_to(directions, shape).astype(real))).mean(axis=1) < OPEN_SHARE
    )


def reaches_sky(sight: Sight, frame: Float64, bounces: int) -> bool:
    """Whether some paths from the camera leave the scene after a hit; true if the camera sees no surface."""
    x = (2 * np.arange(SIDE) + 1) / SIDE - 1
    directions = frame[1] + x[:, None, None] * frame[3] + x[:, None] * frame[2]
    origins: Float64 = np.broadcast_to(frame[0], (SIDE * SIDE, 3))
    directions, started = directions.reshape(-1, 3), 0
    pixels = np.arange(SIDE * SIDE, dtype=np.uint32)
    for bounce in range(bounces + 1):
        hits = sight.intersect(origins, directions)
        (hit,) = np.nonzero(hits.mask)
        if bounce == 0:
            started = len(hit)
        if len(hit) < SUNLESS * started or started == 0:
            return True
        normals = hits.normals()[hit]
        facing = np.where((dots(normals, directions[hit]) > 0)[:, None], -normals, normals)
        words = pcg4d(pixels[hit], 0, bounce + 1, 0)
        outward = cosine_directions(facing, *(to_unit(word, np.dtype(np.float64)) for word in words[:2]))
        origins = sight.scene.spawn(hits.prim[hit], hits.uv[hit], facing).astype(np.float64)
        directions, pixels = outward, pixels[hit]
    return False


def on_sphere(count: int) -> Float64:
    """(count,3) unit vectors spread evenly: the spiral of golden angles."""
    step = np.arange(count) + 0.5
    z = 1 - 2 * step / count
    turn = step * (math.pi * (3 - math.sqrt(5)))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
