"""How much memory a scene will take, before it is built."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from wive._internal import arguments
from wive._internal.options import NodesOption, QualityOption
from wive._internal.precision import real_named

TREE_LIMIT = 8 << 30  # bytes that a tree can have

# Bytes per triangle, the middle of what eleven scenes, grids, spheres and soups take (docs/limits.md).
TREE = {("float32", "float32"): 56.0, ("float64", "float32"): 99.5, ("float64", "compressed"): 94.3}
# Of compressed float32 trees, whose blocks share vertices: by vertices per triangle.
SHARED = (0.5, 0.54, 3.0), (31.0, 35.5, 57.0)
# While building, and what it takes more for any mesh: threads, and large pages that are partly used.
BUILDING = {
    ("float32", "float32"): 127.0,
    ("float32", "compressed"): 125.0,
    ("float64", "float32"): 174.0,
    ("float64", "compressed"): 168.0,
}
HIGH_QUALITY = 11.0
ANY_MESH = 2.7e6


class Estimate(NamedTuple):
    """Bytes of memory that a scene takes."""

    mesh: int
    """Vertices and faces, in the scene's dtypes; not taken again if your arrays have these."""
    tree: int
    """The tree, `Scene.memory`."""
    building: int
    """The most at a time while it is built, the tree included, the mesh not."""


def estimate(
    triangles: int,
    vertices: int | None = None,
    *,
    dtype: DTypeLike = np.float32,
    nodes: NodesOption = "float32",
    quality: QualityOption = "medium",
) -> Estimate:
    """The memory that a scene of so many triangles will take, in bytes; right within 10 % for usual meshes.

    Arguments:
        triangles: how many.
        vertices: how many; if it is None, half as many as triangles, as closed meshes have.
        dtype, nodes, quality: as `Scene` takes them.

    Raises ValueError or TypeError that names the argument, and ValueError for a tree of over 8 GiB.

    >>> wive.estimate(10_000_000).building  # 1.3 GB
    1272700000
    """
    count = arguments.integer("triangles", triangles, 0)
    points = count // 2 + 2 if vertices is None else arguments.integer("vertices", vertices, 0)
    arguments.choice("nodes", nodes, ("float32", "compressed"))
    arguments.choice("quality", quality, ("medium", "high"))
    real = real_named(dtype)
    form = real.name, nodes
    per_triangle = TREE.get(form) or float(np.interp(points / max(count, 1), *SHARED))
    tree = int(count * per_triangle)
    if tree > TREE_LIMIT:
        raise ValueError(
            f"triangles must be at most {int(TREE_LIMIT / per_triangle)} in one scene of these options, "
            f"whose tree can have 8 GiB, got {count}: split the mesh into several scenes"
        )
    building = (BUILDING[form] + HIGH_QUALITY * (quality == "high")) * count + ANY_MESH
    return Estimate(3 * real.dtype.itemsize * points + 12 * count, tree, int(building))
