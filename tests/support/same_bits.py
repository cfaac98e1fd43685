"""Answers of every query on hard and random rays, to compare two machines bit for bit:

    python -m support.same_bits FILE.npz      on the first writes rays and answers, on the second compares

Rays travel in the file: NumPy's own functions round differently on different machines.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import wive
from support.doubles import CPU, rays64, soup64, survey
from support.hard_rays import HARD_MESHES, hard_rays
from support.hard_sets import SETS, hard_set
from support.meshes import random_rays, soup

Inputs = dict[str, tuple[np.ndarray, ...]]
Answers = dict[str, np.ndarray]


def inputs() -> Inputs:
    """Vertices, faces, origins and directions of each name, float32 and float64."""
    found: Inputs = {f"set {name}": hard_set(name) for name in SETS}
    found |= {f"mesh {name}": (*make(), *hard_rays(*make())) for name, make in HARD_MESHES.items()}
    found["soup"] = (*soup(3000, 1), *random_rays(4000, 2))
    found["float64 soup"] = (*soup64(3000, 3), *rays64(4000, 4))
    found["float64 survey"] = (*survey(), *hard_rays(*survey()))
    return found


def answers(backend: str, mesh: tuple[np.ndarray, ...]) -> Iterator[tuple[str, np.ndarray]]:
    """Every answer of every query in each accuracy and node form; NaNs as one NaN, for they have signs."""
    vertices, faces, origins, directions = mesh
    accuracies = ("fast", "watertight", "exact") if vertices.dtype == np.float32 else ("fast", "watertight")
    for nodes in ("float32", "compressed"):
        for accuracy in accuracies:
            scene = wive.Scene(vertices, faces, backend=backend, accuracy=accuracy, nodes=nodes)
            key = f"{nodes} {accuracy} "
            first, every = scene.intersect(origins, directions), scene.intersect_all(origins, directions)
            yield key + "t", first.t
            yield key + "prim", first.prim
            yield key + "uv", first.uv
            yield key + "error bound", first.error_bound
            yield key + "spawned", scene.spawn(first.prim, first.uv, -directions)
            yield key + "occluded", scene.occluded(origins, directions)
            yield key + "count", scene.count(origins, directions)
            yield key + "all t", every.t
            yield key + "all prim", every.prim
        finite = np.isfinite(origins).all(axis=1)
        if len(faces) > 0:
            closest = scene.closest(origins[finite])
            yield nodes + " distance", closest.distance
            yield nodes + " closest prim", closest.prim
            yield nodes + " signed distance", scene.signed_distance(origins[finite], sign="winding")


def bits(array: np.ndarray) -> np.ndarray:
    """The array's bytes, with one NaN for all."""
    if array.dtype.kind == "f":
        array = np.where(np.isnan(array), np.array(np.nan, array.dtype), array)
    return np.frombuffer(np.ascontiguousarray(array).tobytes(), np.uint8)


def main(path: str) -> int:
    """Writes or compares; the exit status."""
    if not Path(path).exists():
        arrays = {}
        for name, mesh in inputs().items():
            arrays |= {f"{name}/{i}": array for i, array in enumerate(mesh)}
            arrays |= {f"{name}/{key}": answer for key, answer in answers("scalar", mesh)}
        np.savez_compressed(path, **arrays)
        print(f"{path}: {len(arrays)} arrays written")
        return 0
    stored = np.load(path)
    wrong, compared = [], 0
    for name in dict.fromkeys(key.partition("/")[0] for key in stored.files):
        mesh = tuple(stored[f"{name}/{i}"] for i in range(4))
        for backend in CPU:
            for key, answer in answers(backend, mesh):
                compared += 1
                if not np.array_equal(bits(answer), bits(stored[f"{name}/{key}"])):
                    wrong.append(f"{name}, {backend}, {key}")
    print(f"{compared} answers compared on {', '.join(CPU)}, {len(wrong)} differ", *wrong, sep="\n")
    return 1 if wrong or not compared else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
