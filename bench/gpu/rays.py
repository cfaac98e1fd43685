"""Rays for a GPU: millions per set, in the orders that matter there, and a set of hard ones."""

import numpy as np
from numpy.typing import NDArray

import wive
from bench.support.rays import SPAWN_OFFSET, Array, bounce, camera_rays, random_rays
from bench.support.scenes import Mesh

TILE = (4, 8)  # rows and columns of pixels: the 32 rays of a warp are neighbours in the picture
GRID_BITS = 6  # sorted rays: origins in 64 cells per axis
FEWEST_DIFFUSE = 1000  # fewer rays measure nothing
SEED = 1

Set = tuple[Array, Array]  # origins and directions


def ray_sets(mesh: Mesh, core: wive.Scene, count: int) -> dict[str, Set]:
    """Primary rays by tiles, second bounces as they come, shuffled and sorted, and random rays."""
    random = np.random.default_rng(SEED)
    side = max(TILE[1], int(count**0.5) // TILE[1] * TILE[1])
    by_tile = tile_order(side)
    origins, directions = camera_rays(mesh.camera, side, random)
    sets: dict[str, Set] = {"primary": (origins[by_tile], directions[by_tile])}
    second = sets["primary"]
    for _ in range(2):
        hits = core.intersect(*second)
        second = bounce(*second, hits.t, hits.normals(), SPAWN_OFFSET * mesh.diagonal, random)
    if len(second[0]) >= FEWEST_DIFFUSE:
        sets["diffuse"] = second
        sets["diffuse_shuffled"] = _taken(second, random.permutation(len(second[0])))
        sets["diffuse_sorted"] = _taken(second, coherent_order(mesh, *second))
    sets["random"] = random_rays(mesh, count, random)
    return sets


def tile_order(side: int) -> NDArray[np.int64]:
    """The pixels of a square picture, tile by tile."""
    rows, columns = TILE
    numbers = np.arange(side * side).reshape(side // rows, rows, side // columns, columns)
    return numbers.swapaxes(1, 2).reshape(-1)


def coherent_order(mesh: Mesh, origins: Array, directions: Array) -> NDArray[np.int64]:
    """Rays by the Morton code of their origin's cell, then by octant."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    cells = 1 << GRID_BITS
    place = (origins - low) / (high - low + np.float32(1e-30)) * cells
    cell = np.clip(place, 0, cells - 1).astype(np.uint32)
    key = ((directions < 0) @ np.array([1, 2, 4])).astype(np.uint32)
    for bit in range(GRID_BITS):
        for axis in range(3):
            key |= (cell[:, axis] >> np.uint32(bit) & np.uint32(1)) << np.uint32(3 + 3 * bit + axis)
    return np.argsort(key, kind="stable")


def hard_rays(
    vertices: NDArray[np.floating], faces: NDArray[np.int32], count: int, seed: int
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Rays at vertices, at middles of edges, along axes with signed zeros, and three that miss by rule."""
    random = np.random.default_rng(seed)
    corners = vertices[faces].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    origins = low + (high - low) * random.random((count, 3))
    directions = random.normal(size=(count, 3))
    face = faces[random.integers(len(faces), size=count)]
    third, tenth = count // 3, count // 10
    directions[:third] = vertices[face[:third, 0]] - origins[:third]
    edges = slice(third, 2 * third)
    directions[edges] = (vertices[face[edges, 0]] + vertices[face[edges, 1]]) / 2 - origins[edges]
    straight = random.choice([0.0, -0.0], (tenth, 3))
    straight[np.arange(tenth), random.integers(3, size=tenth)] = random.choice([-1.0, 1.0], tenth)
    directions[count - tenth :] = straight
    origins, directions = origins.astype(vertices.dtype), directions.astype(vertices.dtype)
    directions[7], origins[11], directions[13, 1] = 0, np.nan, np.inf
    return origins, directions


def _taken(rays: Set, order: NDArray[np.int64]) -> Set:
    return np.ascontiguousarray(rays[0][order]), np.ascontiguousarray(rays[1][order])
