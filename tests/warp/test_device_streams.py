"""Work on a device is on the stream of the library that the rays came in, or finished before it can be used.

On Warp's CPU device there are no streams; these tests see which launches and allocations are made inside a
library's `on_stream` block, which on CUDA sends them to the library's current stream.
"""

import contextlib

import numpy as np
import pytest
from support.meshes import random_rays, sphere

import wive
from wive._internal import arrays

wp = pytest.importorskip("warp")

MESH = sphere(2)
RAYS = random_rays(50, seed=1)
NORMALS = np.tile(np.float32([0, 0, 1]), (50, 1))


@pytest.fixture
def outside(monkeypatch):
    """The names of the launches and allocations outside `on_stream` blocks of Warp's arrays."""
    depth, found = [0], []

    @contextlib.contextmanager
    def on_stream(self, device):
        depth[0] += 1
        try:
            yield
        finally:
            depth[0] -= 1

    def recorded(name, function, describe):
        def call(*arguments, **keywords):
            if depth[0] == 0:
                found.append(describe(*arguments))
            return function(*arguments, **keywords)

        monkeypatch.setattr(wp, name, call)

    monkeypatch.setattr(arrays.WarpArrays, "on_stream", on_stream)
    recorded("launch", wp.launch, lambda kernel, *_: kernel.key)
    for name in ("empty", "zeros", "full"):
        recorded(name, getattr(wp, name), lambda *_, name=name: name)
    return found


def on_device(rows, device):
    return wp.array(rows, dtype=wp.vec3, device=device)


@pytest.mark.parametrize(
    ("query", "result"),
    [
        ("intersect", lambda hits, device: hits.mask),
        ("intersect", lambda hits, device: hits.points()),
        ("intersect", lambda hits, device: hits.normals()),
        ("intersect", lambda hits, device: hits.error_bound),
        ("intersect", lambda hits, device: hits.spawn(NORMALS)),
        ("intersect", lambda hits, device: hits.spawn(NORMALS[0])),
        ("intersect", lambda hits, device: hits.spawn(on_device(NORMALS, device))),
        ("intersect_all", lambda hits, device: hits.counts),
        ("intersect_all", lambda hits, device: hits.ray),
        ("intersect_all", lambda hits, device: hits.points()),
        ("intersect_all", lambda hits, device: hits.normals()),
        ("intersect_all", lambda hits, device: hits[0]),
        ("intersect_all", lambda hits, device: hits[int(np.argmin(hits.counts.numpy()))].points()),
    ],
)
def test_what_hits_compute_when_used_is_on_the_stream_of_their_library(device, outside, query, result):
    scene = wive.Scene(*MESH, device=device)
    hits = getattr(scene, query)(*(on_device(rows, device) for rows in RAYS))
    outside.clear()
    assert result(hits, device) is not None
    assert outside == []


@pytest.mark.parametrize("query", ["intersect", "occluded", "count", "intersect_all"])
def test_queries_are_on_the_stream_of_their_library(device, outside, query):
    scene = wive.Scene(*MESH, device=device)
    rays = [on_device(rows, device) for rows in RAYS]
    outside.clear()
    getattr(scene, query)(*rays, 0.125, on_device(RAYS[0], device).numpy()[0, 0], stats=True)
    assert outside == []


def test_scenes_are_on_their_device_before_a_query_on_any_stream(device, monkeypatch):
    """Construction and refit wait for their last copy and launch; what queries read later is made by then."""
    events = []

    def recorded(name, owner, attribute):
        function = getattr(owner, attribute)

        def call(*arguments, **keywords):
            events.append(name)
            return function(*arguments, **keywords)

        monkeypatch.setattr(owner, attribute, call)

    recorded("array", wp.array, "__init__")
    recorded("launch", wp, "launch")
    recorded("wait", wp, "synchronize_stream")
    rays = [on_device(rows, device) for rows in RAYS]
    scene = wive.Scene(*MESH, device=device)
    assert {"array", "launch"} < set(events)
    assert events[-1] == "wait"
    events.clear()
    scene.refit(MESH[0] * 2)
    assert {"array", "launch"} < set(events)
    assert events[-1] == "wait"
    hits = scene.intersect(*rays)
    hits.points()
    events.clear()
    hits.points()
    assert events.count("array") == 1  # the points: the mesh is on the device already


def test_the_mesh_is_copied_to_the_device_when_first_used(device):
    scene = wive.Scene(*MESH, device=device)
    hits = scene.intersect(*(on_device(rows, device) for rows in RAYS))
    assert hits.mask is not None
    assert "mesh" not in vars(scene._tracer)
    hits.normals()
    assert "mesh" in vars(scene._tracer)
