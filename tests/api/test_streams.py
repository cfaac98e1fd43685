"""Rays of files and mapped arrays, traced in pieces, have the hits of one batch; memory stays as it is."""

import subprocess
import sys
import time

import numpy as np
import pytest
from support.ray_files import COUNT, FORMS, small_scene, some_rays, write_rays

import wive
from wive import _cpu
from wive._internal import ray_files

QUERIES = ["intersect", "occluded", "count", "intersect_all"]


def same(answer, expected) -> None:
    names = [name for name in ("t", "prim", "uv", "offsets") if hasattr(expected, name)]
    for name in names:
        np.testing.assert_array_equal(getattr(answer, name), getattr(expected, name))
    if not names:
        np.testing.assert_array_equal(answer, expected)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("piece", [1, 100, COUNT, 10**6])
def test_pieces_of_a_file_have_the_hits_of_one_batch(tmp_path, form, piece):
    scene, rays = small_scene(), some_rays()
    name, options = write_rays(form, tmp_path, rays)
    whole = scene.intersect(*rays)
    seen = 0
    for first, hits in wive.stream(scene, name, piece=piece, **options):
        assert first == seen
        part = slice(first, first + len(hits))
        for name in ("t", "prim", "uv"):
            np.testing.assert_array_equal(getattr(hits, name), getattr(whole, name)[part])
        seen += len(hits)
    assert seen == COUNT


@pytest.mark.parametrize("query", QUERIES)
def test_every_query_streams(tmp_path, query):
    scene, rays = small_scene(), some_rays()
    name, _ = write_rays("npy", tmp_path, rays)
    for first, answer in wive.stream(scene, name, query=query, piece=300, threads=1):
        same(answer, getattr(scene, query)(*(array[first : first + 300] for array in rays)))


def test_all_cores_trace_while_the_next_rays_are_summed_up(tmp_path, monkeypatch):
    name, _ = write_rays("npz", tmp_path, some_rays())
    scene, cores, used = small_scene(), _cpu.thread_count(), []
    long = np.zeros(1 << 26, np.uint8)
    query = wive.Scene.intersect

    def told(self, origins, directions, *limits, **how):
        if len(origins):
            time.sleep(0.002)
            used.append(how.get("threads") or _cpu.thread_count())
        return query(self, origins, directions, *limits, **how)

    monkeypatch.setattr(ray_files.RunningChecksum, "add", lambda self, array: _cpu.checksum(long, 1))
    monkeypatch.setattr(wive.Scene, "intersect", told)
    wive.trace(scene, name, tmp_path / "hits.npz", piece=300)
    assert used == [cores] * 4


@pytest.mark.parametrize("first", [0, 1, 700, COUNT, COUNT + 5])
@pytest.mark.parametrize("form", FORMS)
def test_a_stream_begins_with_any_ray(tmp_path, form, first):
    scene, rays = small_scene(), some_rays()
    name, options = write_rays(form, tmp_path, rays)
    expected = scene.intersect(*(array[first:] for array in rays))
    found = [hits.t for _, hits in wive.stream(scene, name, first=first, piece=250, **options)]
    np.testing.assert_array_equal(np.concatenate([*found, expected.t[:0]]), expected.t)


@pytest.mark.parametrize("count", [0, 1])
@pytest.mark.parametrize("form", FORMS)
def test_no_rays_and_one_ray_are_rays(tmp_path, form, count):
    name, options = write_rays(form, tmp_path, some_rays(count))
    assert sum(len(hits) for _, hits in wive.stream(small_scene(), name, **options)) == count
    done = wive.trace(small_scene(), name, tmp_path / "hits.npz", **options)
    assert (done.rays, done.resumed) == (count, 0)
    with np.load(tmp_path / "hits.npz") as hits:
        assert hits["uv"].shape == (count, 2)


def test_arrays_stream_as_files_do(tmp_path):
    scene, rays = small_scene(), some_rays()
    table = np.column_stack(rays)
    np.save(tmp_path / "rays.npy", table)
    mapped = np.load(tmp_path / "rays.npy", mmap_mode="r")
    expected = scene.intersect(*rays).t
    for given in (table, mapped, rays, (*rays[:2], rays[2], mapped[:, 7]), table.tolist()):
        found = np.concatenate([hits.t for _, hits in wive.stream(scene, given, piece=200)])
        np.testing.assert_array_equal(found, expected)
    common = scene.intersect(rays[0][0], rays[1]).t
    found = [hits.t for _, hits in wive.stream(scene, (rays[0][0], rays[1]), piece=200)]
    np.testing.assert_array_equal(np.concatenate(found), common)
    masked = np.ma.masked_array(table, table < -0.4)
    limits = masked[:, 6], masked[:, 7]
    found = [hits.t for _, hits in wive.stream(scene, masked, piece=200)]
    expected = scene.intersect(masked[:, :3], masked[:, 3:6], *limits).t
    np.testing.assert_array_equal(np.concatenate(found), expected)


def test_far_rays_of_float64_files_are_brought_near_before_they_are_rounded(tmp_path):
    scene = small_scene()
    origins, directions, *_ = some_rays()
    far = origins.astype(np.float64) - 1e7 * directions
    np.save(tmp_path / "rays.npy", np.column_stack([far, directions]))
    found = np.concatenate([hits.t for _, hits in wive.stream(scene, tmp_path / "rays.npy", piece=100)])
    np.testing.assert_array_equal(found, scene.intersect(far, directions).t)


@pytest.mark.parametrize(
    ("options", "kind", "text"),
    [
        ({"query": "closest"}, ValueError, "^query must be one of"),
        ({"piece": 0}, ValueError, "^piece must be"),
        ({"piece": 1.5}, TypeError, "^piece must be"),
        ({"first": -1}, ValueError, "^first must be"),
        ({"threads": 0}, ValueError, "^threads must be"),
        ({"stats": True}, ValueError, "^stats is not for streams"),
        ({"columns": "ox"}, ValueError, "^columns is only for raw files"),
        ({"raw": "complex64"}, ValueError, "^dtype of raw rays"),
        ({"raw": "no"}, ValueError, "^dtype of raw rays"),
        ({"raw": "f4", "columns": "ox,oy,oz,dx,dy"}, ValueError, "^columns of raw rays"),
        ({"raw": "f4", "columns": "ox,oy,oz,dx,dy,dz,dz"}, ValueError, "^columns of raw rays"),
        ({"raw": "f4", "columns": "ox,oy,oz,dx,dy,dz,t"}, ValueError, "^columns of raw rays"),
        ({"progress": 3}, TypeError, "^progress must be"),
    ],
)
def test_bad_options_are_refused_before_the_first_piece(tmp_path, options, kind, text):
    name, _ = write_rays("npy", tmp_path, some_rays(5))
    with pytest.raises(kind, match=text):
        wive.stream(small_scene(), name, **options)


def test_files_that_hold_no_rays_are_refused_by_name(tmp_path):
    scene, rays = small_scene(), some_rays(50)
    name, _ = write_rays("npy", tmp_path, rays)
    data = name.read_bytes()
    (tmp_path / "cut.npy").write_bytes(data[:-1])
    (tmp_path / "no.npy").write_bytes(b"nothing")
    (tmp_path / "cut.raw").write_bytes(bytes(25))
    np.save(tmp_path / "one.npy", np.zeros(6))
    np.savez(tmp_path / "few.npz", origins=rays[0], directions=rays[1][:-1])
    np.savez(tmp_path / "limits.npz", origins=rays[0], directions=rays[1], tmax=rays[3][:-1])
    np.savez(tmp_path / "two.npz", rays=rays[0], more=rays[1])
    for file, options, text in (
        ("cut.npy", {}, "not a file of rays.*claims shape"),
        ("no.npy", {}, "not a file of rays"),
        ("cut.raw", {"raw": "f4"}, "holds 25 bytes, no multiple of 24"),
        ("one.npy", {}, r"found shape \(6,\)"),
        ("few.npz", {}, "equally many, got 50 and 49"),
        ("limits.npz", {}, r"tmax must be one number or have shape \(50,\)"),
        ("two.npz", {}, "found arrays more, rays"),
        ("gone.npy", {}, "no such file"),
    ):
        with pytest.raises((ValueError, OSError), match=text) as error:
            list(wive.stream(scene, tmp_path / file, **options))
        assert file in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("form", ["npz", "deflated"])
def test_damage_of_an_archive_is_found_by_its_end(tmp_path, form):
    name, _ = write_rays(form, tmp_path, some_rays())
    data = bytearray(name.read_bytes())
    data[len(data) // 4] ^= 1
    name.write_bytes(data)
    with pytest.raises(ValueError, match=r"rays\.npz: not a file of rays"):
        wive.trace(small_scene(), name, tmp_path / "hits.npz", piece=100)
    assert [path.name for path in tmp_path.iterdir()] == ["rays.npz"]


def test_a_stream_that_is_left_closes_its_files(tmp_path, recwarn):
    name, _ = write_rays("npy", tmp_path, some_rays())
    for _first, _hits in wive.stream(small_scene(), name, piece=10):
        break
    name.unlink()
    assert not recwarn


GROWTH = """
import numpy as np, sys, wive
def peak():
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))
scene = wive.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
peaks = []
for count in (1 << 18, 1 << 21):
    with open("rays.raw", "wb") as file:
        for _ in range(count >> 14):
            file.write(np.tile(np.float32([0.2, 0.3, 5, 0, 0, -1]), 1 << 14))
    for query in ("intersect", "intersect_all"):
        wive.trace(scene, "rays.raw", f"{query}{count}.npz", query=query, raw="f4", piece=1 << 16)
    for _ in wive.stream(scene, np.memmap("rays.raw", np.float32, "r", shape=(count, 6)), piece=1 << 16):
        pass
    peaks.append(peak())
    open("/proc/self/clear_refs", "w").write("5")
print(peaks[1] - peaks[0])
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_memory_does_not_grow_with_the_number_of_rays(tmp_path):
    ran = subprocess.run(
        [sys.executable, "-c", GROWTH], capture_output=True, text=True, cwd=tmp_path, timeout=120
    )
    assert ran.returncode == 0, ran.stderr
    assert int(ran.stdout) < 16_000  # KiB; rays and hits of 2^21 rays are 84 MiB
