"""Work on a device is on the stream of the library that the rays came in, or finished before it can be used.

On Warp's CPU device there are no streams; these tests see which launches and allocations are made inside a
library's `on_stream` block, which on CUDA sends them to the library's current stream.
"""

import contextlib
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from support.meshes import random_rays, sphere

import wive
from wive import _cpu
from wive._internal import arrays

wp = pytest.importorskip("warp")

from wive.warp_kernels import launch_all, launch_count, scan_counts, upload

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


def test_an_upload_waits_for_its_last_launch(device, monkeypatch):
    events = []
    launch, wait = wp.launch, wp.synchronize_stream
    monkeypatch.setattr(wp, "launch", lambda *a, **k: (events.append("launch"), launch(*a, **k)))
    monkeypatch.setattr(wp, "synchronize_stream", lambda *a: (events.append("wait"), wait(*a)))
    upload(_cpu.Bvh(*MESH), device)
    assert events == ["launch", "wait"]


def test_the_hits_of_launch_all_are_allocated_on_the_stream_that_it_is_given(device, monkeypatch):
    """There they are freed as well: memory is reused in the order of a stream."""
    given, current, found = object(), [None], []

    @contextlib.contextmanager
    def scoped(stream, sync_enter=True):
        current.append(stream)
        yield
        current.pop()

    def recorded(function):
        return lambda *a, **k: (found.append((current[-1], k.get("stream"))), function(*a, **k))[1]

    tree, rays = upload(_cpu.Bvh(*MESH), device), [on_device(rows, device) for rows in RAYS]
    rays += [wp.full(1, limit, dtype=wp.float32, device=device) for limit in (0.0, np.inf)]
    counts = wp.zeros(50, dtype=wp.int32, device=device)
    launch_count(tree, *rays, counts)
    offsets = scan_counts(counts)
    outputs = [wp.empty(int(offsets.numpy()[-1]), dtype=dtype) for dtype in (wp.float32, wp.int32, wp.vec2)]
    monkeypatch.setattr(wp, "ScopedStream", scoped)
    for name in ("empty", "launch"):
        monkeypatch.setattr(wp, name, recorded(getattr(wp, name)))
    launch_all(tree, *rays, counts, offsets, *outputs, stream=given)
    assert found == [(given, None)] * 3  # hits, their list, the sort


@pytest.mark.parametrize("capturing", [False, True])
def test_work_on_a_stream_of_torch_goes_before_what_warp_does_next(monkeypatch, capturing):
    """Warp frees memory on its own stream, behind the work; a graph of torch holds no other stream."""
    made = []
    stream = SimpleNamespace(is_capturing=capturing)
    torch = SimpleNamespace(cuda=SimpleNamespace(current_stream=lambda device: ("torch's", device)))
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setattr(wp, "stream_from_torch", lambda found: made.append(found) or stream)
    monkeypatch.setattr(wp, "ScopedStream", lambda *a, **k: made.append((*a, k)))
    arrays.TORCH.on_stream("cuda:0")
    assert made == [
        ("torch's", "cuda:0"),
        (stream, {"sync_enter": False, "sync_exit": not capturing}),
    ]


def test_a_graph_holds_queries_and_what_their_hits_compute(device):
    """Replayed, it gives the answers for the rays that its arrays hold by then."""
    scene = wive.Scene(*MESH, device=device)
    origins, directions = (on_device(rows, device) for rows in RAYS)
    up = on_device(NORMALS, device)

    def everything():
        hits = scene.intersect(origins, directions)
        names = ("t", "prim", "uv", "mask", "geom", "geom_prim", "error_bound", "front")
        return {
            **{name: getattr(hits, name) for name in names},
            **{name: getattr(hits, name)() for name in ("points", "normals", "cosines")},
            "spawn": hits.spawn(up),
            "occluded": scene.occluded(origins, directions),
            "count": scene.count(origins, directions),
        }

    everything()  # kernels are compiled and the mesh is on the device
    with wp.ScopedCapture(device=device) as capture:
        answers = everything()
    moved = random_rays(50, seed=2)
    for array, rows in zip((origins, directions), moved, strict=True):
        array.assign(rows)
    wp.capture_launch(capture.graph)
    for name, wanted in everything().items():
        np.testing.assert_array_equal(answers[name].numpy(), wanted.numpy(), err_msg=name)
    assert len(np.unique(answers["prim"].numpy())) > 5


def test_the_mesh_is_copied_to_the_device_when_first_used(device):
    scene = wive.Scene(*MESH, device=device)
    hits = scene.intersect(*(on_device(rows, device) for rows in RAYS))
    assert hits.mask is not None
    assert "mesh" not in vars(scene._tracer)
    hits.normals()
    assert "mesh" in vars(scene._tracer)
