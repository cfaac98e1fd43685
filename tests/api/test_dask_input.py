"""What wive.dask refuses, before anything is computed; and pictures in tiles."""

import importlib.util
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from support.dask_arrays import (
    DIRECTIONS,
    ORIGINS,
    da,
    in_chunks,
    note_queries,
    same,
    scene_of,
)

import wive
import wive.dask

RAYS = da.zeros((6, 3), chunks=2), da.ones((6, 3), chunks=3)
REFUSED = [
    (("scene",), {}, TypeError, "scene must be a wive.Scene, got str"),
    ((None, *RAYS), {"threads": 0}, ValueError, "threads must be from 1 to 2147483647, got 0"),
    ((None, *RAYS), {"threads": 1.5}, TypeError, "threads must be an integer, got float 1.5"),
    ((None, *RAYS), {"in_flight": 0}, ValueError, "in_flight must be from 1"),
    ((None, *RAYS), {"lanes": 8}, ValueError, "lanes is only for backend 'warp', got 8 with backend"),
    ((None, *RAYS), {"touching": "yes"}, TypeError, "touching must be"),
    ((None, *RAYS), {"max_bytes": 0}, ValueError, "max_bytes must be from 1"),
    ((None, np.zeros((6, 3)), [0, 0, 1]), {}, TypeError, "origins or directions must be a dask array, got"),
    ((None, da.zeros((6, 2)), RAYS[1]), {}, ValueError, "origins must have shape (..., 3), one vector"),
    ((None, RAYS[0], da.zeros(6)), {}, ValueError, "directions must have shape (..., 3), one vector"),
    ((None, RAYS[0], da.zeros((5, 3))), {}, ValueError, "origins and directions must have one shape, or"),
    ((None, RAYS[0], np.zeros((5, 3))), {}, ValueError, "origins and directions must have one shape, or"),
    ((None, da.zeros((6, 3), dtype=bool), RAYS[1]), {}, TypeError, "origins must be an (n, 3) array of real"),
    ((None, RAYS[0], ["a", "b", "c"]), {}, TypeError, "directions must be an array of real numbers"),
    ((None, *RAYS, da.zeros(5)), {}, ValueError, "tmin must be one number or have shape (6,)"),
    ((None, *RAYS, 0, np.zeros((6, 1))), {}, ValueError, "tmax must be one number or have shape (6,)"),
    ((None, *RAYS, 0, da.zeros(6, dtype=bool)), {}, TypeError, "tmax must be a real number or one per ray"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "options", "error", "message"), REFUSED)
def test_bad_input_is_refused_before_anything_is_computed(given, options, error, message, monkeypatch):
    traced = note_queries(monkeypatch)
    scene, *rays = given if len(given) > 1 else (*given, *RAYS)
    scene = scene_of() if scene is None else scene
    queries = ["intersect_all"]
    if "max_bytes" not in options:
        queries.append("count")
    if "max_bytes" not in options and "touching" not in options:
        queries += ["intersect", "occluded"]
    for name in queries:
        with pytest.raises(error, match="^" + re.escape(message)) as caught:
            getattr(wive.dask, name)(scene, *rays, **options)
        assert "\n" not in str(caught.value)
    assert traced == []


def test_hits_that_do_not_fit_are_a_memory_error():
    scene = scene_of()
    rays = in_chunks(ORIGINS), in_chunks(DIRECTIONS)
    with pytest.raises(MemoryError, match="max_bytes"):
        wive.dask.intersect_all(scene, *rays, max_bytes=10).t.compute()
    with pytest.raises(ValueError, match=r"^directions must have shape \(600, 3\), one per hit, or \(3,\)"):
        wive.dask.intersect(scene, *rays).spawn(da.zeros((5, 3)))


@pytest.mark.parametrize(
    ("shading", "exposure"),
    [("auto", "auto"), ("path", 1.5), ("ao", "auto"), ("headlight", 0), ("normals", 0), ("depth", 0)],
)
def test_a_picture_in_tiles_is_that_of_render(shading, exposure):
    scene = scene_of()
    how = {"shading": shading, "width": 24, "height": 19, "spp": 3, "sky": "cloudy", "exposure": exposure}
    if shading != "auto":
        how |= {"camera": wive.Camera.framing(scene.bounds), "albedo": (0.5, 0.7, 0.2)}
    picture = wive.dask.render(scene, rows=5, **how)
    assert picture.chunks[0] == (5, 5, 5, 4)
    same(picture, wive.render(scene, **how))


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"rows": 0}, ValueError, "rows must be from 1"),
        ({"rows": 1.5}, TypeError, "rows must be an integer"),
        ({"progress": True}, TypeError, "render() got an unexpected keyword argument 'progress'"),
        ({"camera": "here"}, TypeError, "camera must be a wive.Camera or wive.PinholeCamera, or None"),
        ({"threads": 0}, ValueError, "threads must be from 1"),
        ({"exposure": "bright"}, ValueError, "exposure must be a number of stops or 'auto'"),
    ],
)
def test_bad_pictures_are_refused_before_anything_is_computed(options, error, message):
    with pytest.raises(error, match="^" + re.escape(message)):
        wive.dask.render(scene_of(), **options)
    with pytest.raises(TypeError, match=r"^scene must be a wive\.Scene, got int"):
        wive.dask.render(3)


@pytest.mark.skipif(
    importlib.util.find_spec("dask.array._array_expr") is None, reason="this dask has no such arrays"
)
def test_arrays_of_dasks_experiment_are_refused(tmp_path):
    finished = subprocess.run(
        [sys.executable, "-c", "import wive.dask"],
        env={**os.environ, "DASK_ARRAY__QUERY_PLANNING": "True"},
        cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert finished.stderr.splitlines()[-1].startswith(
        "ImportError: wive.dask needs dask's usual arrays, got"
    )
