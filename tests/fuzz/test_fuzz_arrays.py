"""Arrays of any dtype, order, stride, alignment and class mean their numbers, or are refused in one line."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from support.meshes import sphere
from support.odd_arrays import odd_array

import wive

CPU = [name for name, backend in wive.backends().items() if backend.usable and name != "warp"]
COUNT = 20


def outcome(work: Any, *arguments: Any) -> Any:
    """The result, or the one line of a refusal."""
    try:
        return work(*arguments)
    except (TypeError, ValueError) as error:
        assert "\n" not in str(error), error
        return str(error)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("backend", CPU)
def test_rays_mean_their_numbers(backend: str, dtype: type, seeds: Iterator[int]) -> None:
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices.astype(dtype) * 3, faces, backend=backend)
    for seed in seeds:
        random = np.random.default_rng(seed)
        origins, origin_values = odd_array(random, random.integers(-4, 5, (COUNT, 3)))
        directions, direction_values = odd_array(random, random.integers(-4, 5, (COUNT, 3)))
        tmin, tmin_values = odd_array(random, random.integers(0, 3, COUNT))
        found = outcome(scene.intersect, origins, directions, tmin)
        if isinstance(found, str):
            assert found.split()[0].rstrip(":,") in ("origins", "directions", "tmin", "tmax"), (seed, found)
        if origin_values is None or direction_values is None or tmin_values is None:
            assert isinstance(found, str), seed
            continue
        assert not isinstance(found, str), (seed, found)
        plain = scene.intersect(
            *(array.astype(dtype) for array in (origin_values, direction_values, tmin_values))
        )
        assert found.t.tobytes() == plain.t.tobytes(), seed
        assert found.prim.tobytes() == plain.prim.tobytes(), seed


def test_meshes_mean_their_numbers(seeds: Iterator[int]) -> None:
    corners, triangles = sphere(1)
    for seed in seeds:
        random = np.random.default_rng(seed)
        vertices, vertex_values = odd_array(random, np.rint(corners * 9).astype(int))
        faces, face_values = odd_array(random, triangles.astype(int))
        found = outcome(wive.Scene, vertices, faces)
        if isinstance(found, str):
            assert found.split()[0].rstrip(":,") in ("vertices", "faces"), (seed, found)
        if vertex_values is None or face_values is None:
            assert isinstance(found, str), seed
        elif not isinstance(found, str):
            assert (found.vertices == vertex_values).all(), seed
            assert (found.faces == face_values).all(), seed
        else:  # faces must be integers
            assert found.startswith("faces"), (seed, found)
            assert np.asarray(faces).dtype.kind == "f", (seed, found)
