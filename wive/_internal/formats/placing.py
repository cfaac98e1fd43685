"""Copies of meshes, placed in the world by matrices and joined in order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats import Mesh
from wive._internal.room import expect_room

Matrix = NDArray[np.float64]
IDENTITY = np.eye(4)
# Vertices (n,3), corners (f,3) and matrices (k,4,4) of the k copies of a mesh.
Part = tuple[NDArray[Any], NDArray[np.int32], Matrix]
BATCH = 1 << 16  # vertices placed at once: their coordinates stay in the cache
MOST = 2**31 - 1  # vertices and triangles are numbered by int32
# Nodes that hold copies of nodes make any number of them from a small file: so many take half a minute.
MOST_STEPS = 1 << 23
LAST_ROW_ERROR = 1e-5  # products of float32 matrices


class Counts(NamedTuple):
    """Vertices and triangles of all copies in a part of a scene, and the steps that place them."""

    vertices: int
    triangles: int
    steps: int

    @classmethod
    def of(cls, vertices: int, triangles: int, below: Sequence[Counts] = ()) -> Counts:
        """Those of a node with so many of its own and all that it holds; steps lead to no empty node."""
        total = cls(*map(sum, zip((vertices, triangles, 0), *below, strict=True)))
        steps = total.steps + 1 + len(below)
        return total._replace(steps=steps) if total.vertices or total.triangles else NOTHING

    def check(self) -> None:
        """Raise ValueError if there are too many copies, MemoryError if memory can't hold them."""
        if max(self.vertices, self.triangles) > MOST:
            raise ValueError(
                f"scene: has {self.vertices} vertices and {self.triangles} triangles, expected at most {MOST}"
            )
        if self.steps > MOST_STEPS:
            raise ValueError(
                f"scene: places its copies in {self.steps:,} steps, expected at most {MOST_STEPS:,}: "
                "export the copies as one mesh"
            )
        # Placed in double; then joined, in half of that.
        expect_room(3 * (self.vertices + self.triangles), np.float64)


NOTHING = Counts(0, 0, 0)


def affine(matrix: Matrix, place: str) -> Matrix:
    """The matrix (4,4) with a last row of exactly 0 0 0 1, which exporters may have rounded.

    Raises ValueError if it is farther from that, or if a number is not finite.
    """
    if not (np.isfinite(matrix).all() and np.abs(matrix[3] - IDENTITY[3]).max() <= LAST_ROW_ERROR):
        row = " ".join(f"{number:g}" for number in matrix[3].tolist())
        raise ValueError(f"{place}: expected finite numbers and a last row of 0 0 0 1, found {row}")
    return np.vstack([matrix[:3], IDENTITY[3:]])


def joined(parts: Iterable[Part]) -> Mesh:
    """Vertices and faces of all parts in order, each with a copy per matrix.

    A mirrored copy turns the other side of its triangles out: their corners 1 and 2 change places, so that
    normals point as they do in the mesh. Vertices are float32 if all parts' are and no matrix moves them.
    """
    vertices: list[NDArray[Any]] = [np.empty((0, 3), np.float32)]
    faces = [np.empty((0, 3), np.int32)]
    start = 0
    for points, corners, matrices in together(parts):
        vertices.append(placed(points, matrices).reshape(-1, 3))
        mirrored = np.linalg.det(matrices[:, :3, :3]) < 0
        copies = np.where(mirrored[:, None, None], corners[:, [0, 2, 1]], corners)
        starts = start + len(points) * np.arange(len(matrices), dtype=np.int32)
        faces.append((copies + starts[:, None, None]).reshape(-1, 3))
        start += len(vertices[-1])
    return np.concatenate(vertices), np.concatenate(faces)


def together(parts: Iterable[Part]) -> Iterator[Part]:
    """The parts, with copies of one mesh that follow each other as one part, of BATCH vertices or so."""
    for _, same in groupby(parts, key=lambda part: (id(part[0]), id(part[1]))):
        first, *rest = same
        points, corners, _ = first
        matrices = np.concatenate([part[2] for part in (first, *rest)])
        some = max(1, BATCH // max(1, len(points)))
        for at in range(0, len(matrices), some):
            yield points, corners, matrices[at : at + some]


def placed(positions: NDArray[Any], matrices: Matrix) -> NDArray[Any]:
    """Positions (k,n,3) in the world of k copies of a mesh; the same numbers if no matrix moves them."""
    if (matrices == IDENTITY).all():
        return np.broadcast_to(positions, (len(matrices), *positions.shape))
    return moved(positions, matrices[:, None, :3])


def moved(positions: NDArray[Any], matrices: Matrix) -> Matrix:
    """Positions (n,3) times matrices (...,n,3,4) or (...,1,3,4).

    Written out per component: a product by BLAS may round a vertex by its place in the array, and so open the
    seam between two meshes.
    """
    x, y, z = (positions[:, axis].astype(np.float64) for axis in range(3))
    rows = [
        matrices[..., row, 0] * x
        + matrices[..., row, 1] * y
        + matrices[..., row, 2] * z
        + matrices[..., row, 3]
        for row in range(3)
    ]
    return np.stack(rows, axis=-1)
