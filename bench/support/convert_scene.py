"""Converts meshes into a scene file: `python -m bench convert SOURCE... -o NAME.npz`.

Reads what trimesh reads (OBJ, PLY, glTF, STL, ...), PBRT's PLY files among them. The parts of all files are
placed by their transforms and merged; equal positions become one vertex. Slivers without an area and
coincident faces stay: queries have to deal with them. The file holds `vertices` (v,3) float32 and `faces`
(f,3) int32.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import BenchError
from wive._internal.files import atomic_write, check_output


def main(options: Sequence[str]) -> None:
    """Converts the files named on the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m bench convert", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("sources", metavar="SOURCE", type=Path, nargs="+", help="files of one scene")
    parser.add_argument("-o", "--out", type=Path, required=True, help="the scene file, NAME.npz")
    chosen = parser.parse_args(options)
    if chosen.out.suffix != ".npz":
        raise BenchError(f"expected a file NAME.npz to write, got {chosen.out}")
    try:
        check_output(chosen.out, inputs=chosen.sources)
    except (OSError, ValueError) as problem:
        raise BenchError(str(problem)) from None
    vertices, faces = merged([part for source in chosen.sources for part in parts(source)])
    with atomic_write(chosen.out) as file:
        np.savez_compressed(file, vertices=vertices, faces=faces)
    print(f"wrote {chosen.out}: {len(vertices):,} vertices, {len(faces):,} triangles")
    print(f"For cameras.json beside it: {json.dumps({chosen.out.stem: outside_camera(vertices)})}")


def parts(source: Path) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Vertices and triangles of each part of a file, in the file's own coordinates."""
    import trimesh

    scene: Any
    try:
        scene = trimesh.load(source, force="scene", process=False)
    except (ValueError, NotImplementedError) as problem:
        raise BenchError(f"{source} can't be read: {problem}") from None
    meshes = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    if not meshes:
        raise BenchError(f"there are no triangles in {source}")
    return [(np.asarray(mesh.vertices), np.asarray(mesh.faces)) for mesh in meshes]


def merged(
    meshes: Sequence[tuple[NDArray[np.float64], NDArray[np.int64]]],
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """One mesh of all parts, in which vertices at equal float32 positions are one."""
    points = np.concatenate([vertices for vertices, _ in meshes]).astype(np.float32)
    first = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    corners = np.concatenate([faces + start for (_, faces), start in zip(meshes, first[:-1], strict=True)])
    vertices, number = np.unique(points, axis=0, return_inverse=True)
    return vertices, number.reshape(-1)[corners].astype(np.int32)


def outside_camera(vertices: NDArray[np.float32]) -> dict[str, object]:
    """A camera that sees the whole scene from outside, to begin with; z is up."""
    low, high = vertices.min(axis=0).astype(np.float64), vertices.max(axis=0).astype(np.float64)
    target = (low + high) / 2
    eye = target + float(np.linalg.norm(high - low)) * np.array([0.8, -0.9, 0.6])
    return {"eye": eye.tolist(), "target": target.tolist(), "up": [0, 0, 1], "fov": 45}
