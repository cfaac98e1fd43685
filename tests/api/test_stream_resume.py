"""`wive.trace` writes a whole output or none, and a run that goes on after an interruption loses nothing."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from support.ray_files import COUNT, FORMS, arrays_of, content_of, small_scene, some_rays, write_rays

import wive
from wive._internal import hit_columns, hit_files, progress
from wive._internal.files import UNFINISHED

OUTPUTS = ["hits.npz", "hits/"]
QUERIES = ["intersect", "intersect_all"]


class Stop(Exception):
    """What the tests end a run with."""


@pytest.fixture(autouse=True)
def told_at_once(monkeypatch):
    monkeypatch.setattr(progress, "PERIOD", 0)


def trace(folder, output="hits.npz", query="intersect", piece=100, scene=None, form="npy", **options):
    name, given = write_rays(form, folder, some_rays())
    return wive.trace(
        scene or small_scene(), name, f"{folder}/{output}", query=query, piece=piece, **given, **options
    )


def interrupt(folder, output="hits.npz", query="intersect", *, after=450, error=Stop, **options):
    """A run that ends by an error once so many rays are traced."""

    def stop(done, total):
        if done >= after:
            raise error

    with pytest.raises(error) as raised:
        trace(folder, output, query, progress=stop, **options)
    return raised.value


def content_of_run(folder, query):
    """The bytes of an output of a run without interruption."""
    folder.mkdir()
    trace(folder, query=query)
    return content_of(folder / "hits.npz")


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("query", QUERIES)
def test_the_output_has_the_arrays_of_the_scene_s_hits(tmp_path, output, query):
    done = trace(tmp_path, output, query)
    hits = getattr(small_scene(), query)(*some_rays())
    found = arrays_of(tmp_path / output)
    assert sorted(found) == sorted(["t", "prim", "uv", *(["offsets"] if query == "intersect_all" else [])])
    for name, array in found.items():
        np.testing.assert_array_equal(array, getattr(hits, name))
        assert array.dtype == getattr(hits, name).dtype
    assert (done.rays, done.hits) == (COUNT, np.count_nonzero(hits.prim >= 0))
    assert sorted(path.name for path in tmp_path.iterdir()) == [output.strip("/"), "rays.npy"]


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("query", QUERIES)
@pytest.mark.parametrize("form", FORMS)
def test_a_resumed_run_writes_the_bytes_of_one_without_interruption(tmp_path, output, query, form):
    trace(tmp_path, "whole" + output, query, piece=64, form=form)
    error = interrupt(tmp_path, output, query, form=form, error=KeyboardInterrupt)
    kept = f"rays are kept in {tmp_path}/{output.strip('/')}.part: resume"
    assert kept in str(error)
    assert not (tmp_path / output).exists()
    done = trace(tmp_path, output, query, piece=77, form=form, resume=True)
    assert 450 <= done.resumed < COUNT
    assert content_of(tmp_path / output) == content_of(tmp_path / ("whole" + output))
    assert not list(tmp_path.glob("*.part"))


def test_a_run_may_be_interrupted_many_times(tmp_path):
    trace(tmp_path, "whole.npz", "intersect_all")
    for after in (1, 2, 3, 100, 101, 999):
        interrupt(tmp_path, query="intersect_all", after=after, piece=after % 7 + 1, resume=True)
    trace(tmp_path, query="intersect_all", resume=True)
    assert content_of(tmp_path / "hits.npz") == content_of(tmp_path / "whole.npz")


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("query", QUERIES)
@pytest.mark.parametrize("writes", range(1, 36, 6))
def test_a_full_disk_leaves_no_half_file_and_what_was_done_can_go_on(
    tmp_path, monkeypatch, output, query, writes
):
    trace(tmp_path, "whole" + output, query)
    write, left = hit_columns._write_at, writes

    def full(file, data, place):
        nonlocal left
        left -= 1
        if left < 0:
            write(file, data[: len(data) // 2], place)
            raise OSError(errno.ENOSPC, "No space left on device")
        write(file, data, place)

    with monkeypatch.context() as patched:
        patched.setattr(hit_columns, "_write_at", full)
        with pytest.raises(OSError, match="No space left on device") as error:
            trace(tmp_path, output, query)
    assert output in str(error.value) and "\n" not in str(error.value)
    assert not (tmp_path / output).exists()
    assert ("are kept" in str(error.value)) == (tmp_path / f"{output.strip('/')}.part").exists()
    trace(tmp_path, output, query, resume=True)
    assert content_of(tmp_path / output) == content_of(tmp_path / ("whole" + output))


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_disk_without_room_for_the_output_is_found_before_the_first_ray(tmp_path, monkeypatch, output):
    def full(file, begin, size):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OSError, match="nothing was written"):
        trace(tmp_path, output, progress=lambda done, total: pytest.fail("traced"))
    assert [path.name for path in tmp_path.iterdir()] == ["rays.npy"]


@pytest.mark.parametrize("output", OUTPUTS)
def test_an_interrupted_run_is_not_begun_again_unasked(tmp_path, output):
    interrupt(tmp_path, output)
    before = content_of(tmp_path / f"{output.strip('/')}.part/content")
    with pytest.raises(FileExistsError, match="rays of an interrupted run: resume it, or delete the folder"):
        trace(tmp_path, output)
    assert content_of(tmp_path / f"{output.strip('/')}.part/content") == before
    assert trace(tmp_path, output, resume=True).resumed > 0


def other_mesh() -> wive.Scene:
    scene = small_scene()
    return wive.Scene(scene.vertices, scene.faces[::-1])


@pytest.mark.parametrize("is_complete", [False, True])
@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"scene": other_mesh}, "another mesh"),
        (
            {"scene": lambda: wive.Scene(small_scene().vertices, small_scene().faces, accuracy="exact")},
            "accuracy",
        ),
        (
            {"scene": lambda: wive.Scene(small_scene().vertices, small_scene().faces, dtype=float)},
            "precision",
        ),
        ({"query": "intersect"}, "another query"),
        ({"touching": True}, "touching"),
        ({"form": "npy of float64"}, "kind of rays"),
    ],
)
def test_a_run_does_not_go_on_with_another_mesh_or_other_options(tmp_path, is_complete, changed, text):
    if is_complete:
        trace(tmp_path, query="intersect_all")
    else:
        interrupt(tmp_path, query="intersect_all")
    options = {"query": "intersect_all", **changed}
    if "scene" in options:
        options["scene"] = options["scene"]()
    with pytest.raises(ValueError, match=text) as error:
        trace(tmp_path, resume=True, **options)
    assert "hits.npz" in str(error.value) and "\n" not in str(error.value)
    again = trace(tmp_path, query="intersect_all", resume=True)
    assert again.resumed == COUNT if is_complete else 0 < again.resumed < COUNT


@pytest.mark.parametrize("is_complete", [False, True])
def test_a_run_does_not_go_on_with_other_rays(tmp_path, is_complete):
    name, _ = write_rays("npy", tmp_path, some_rays())
    table = np.load(name)

    def run(rays, **options):
        np.save(name, rays)
        return wive.trace(small_scene(), name, tmp_path / "hits.npz", piece=100, resume=True, **options)

    def stop(done, total):
        if done > 450:
            raise Stop

    if is_complete:
        run(table)
    else:
        with pytest.raises(Stop):
            run(table, progress=stop)
    changed = table.copy()
    changed[123, 4] += 1
    with pytest.raises(ValueError, match="was of other rays"):
        run(changed)
    with pytest.raises(ValueError, match="another number of rays"):
        run(table[:-1])
    assert run(table).resumed > 400


@pytest.mark.parametrize("output", OUTPUTS)
def test_resuming_a_complete_run_does_nothing(tmp_path, output):
    assert trace(tmp_path, output, resume=True).resumed == 0
    before = content_of(tmp_path / output)
    again = trace(tmp_path, output, resume=True)
    assert again.resumed == again.rays == COUNT and again.hits > 0
    assert content_of(tmp_path / output) == before


def test_a_killed_run_that_was_not_written_down_begins_again(tmp_path):
    whole = tmp_path / "whole.npz"
    trace(tmp_path, "whole.npz")
    (tmp_path / "hits.npz.part" / "content").mkdir(parents=True)
    (tmp_path / "hits.npz.part" / "content" / "npz").write_bytes(b"half")
    trace(tmp_path)
    assert content_of(tmp_path / "hits.npz") == content_of(whole)


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("goes_on", [False, True])
def test_ctrl_c_while_a_run_begins_leaves_all_as_it_was(tmp_path, monkeypatch, output, goes_on):
    if goes_on:
        interrupt(tmp_path, output)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.name != "rays.npy"}

    def open_files(self, folder):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(hit_columns.HitColumns, "open", open_files)
        trace(tmp_path, output, resume=True)
    after = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.name != "rays.npy"}
    assert after == before
    assert trace(tmp_path, output, resume=True).resumed == (500 if goes_on else 0)


def ended_in_place(monkeypatch, error):
    """Runs end by the error as soon as their output is in place."""

    def remove(self):
        raise error

    monkeypatch.setattr(hit_files.HitFile, "_remove", remove)


@pytest.mark.parametrize("query", QUERIES)
def test_a_run_that_is_killed_when_its_output_is_in_place_was_complete(tmp_path, monkeypatch, query):
    monkeypatch.setattr(hit_files, "CHECKPOINT", 0)
    expected = content_of_run(tmp_path / "other", query)
    with monkeypatch.context() as patched, pytest.raises(Stop):
        ended_in_place(patched, Stop)
        patched.setattr(hit_files.HitFile, "end", lambda self, error: self.close() or "")  # no time for that
        trace(tmp_path, query=query)
    assert (tmp_path / "hits.npz.part" / "state.json").exists()
    assert trace(tmp_path, query=query, resume=True).resumed == COUNT
    assert content_of(tmp_path / "hits.npz") == expected
    assert not (tmp_path / "hits.npz.part").exists()


def test_a_record_is_never_taken_for_one_of_another_run(tmp_path, monkeypatch):
    """One run was killed when its output was in place, the next one before it had a record."""
    monkeypatch.setattr(hit_files, "CHECKPOINT", 0)
    with monkeypatch.context() as patched, pytest.raises(Stop):
        ended_in_place(patched, Stop)
        patched.setattr(hit_files.HitFile, "end", lambda self, error: self.close() or "")
        trace(tmp_path)
    expected = content_of(tmp_path / "hits.npz")
    (tmp_path / "hits.npz").unlink()
    monkeypatch.setattr(hit_files, "CHECKPOINT", 1e9)
    with monkeypatch.context() as patched:
        patched.setattr(hit_files.HitFile, "end", lambda self, error: self.close() or "")
        interrupt(tmp_path)
    assert trace(tmp_path, resume=True).resumed == 0
    assert content_of(tmp_path / "hits.npz") == expected


@pytest.mark.parametrize("output", OUTPUTS)
def test_ctrl_c_when_the_output_is_in_place_leaves_it_whole(tmp_path, monkeypatch, output):
    replace, calls = os.replace, []

    def interrupted(*names):
        replace(*names)
        if not calls and "content" in str(names[0]):
            calls.append(names)
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt, match=r"^$"):
        trace(tmp_path, output)
    assert sorted(path.name for path in tmp_path.iterdir()) == [output.rstrip("/"), "rays.npy"]
    assert trace(tmp_path, output, resume=True).resumed == COUNT


def test_a_run_killed_while_its_record_was_written_can_be_resumed(tmp_path):
    interrupt(tmp_path)
    (tmp_path / "hits.npz.part" / "0123456789abcdef".join(UNFINISHED)).write_text("{")
    assert trace(tmp_path, resume=True).resumed > 0
    assert not (tmp_path / "hits.npz.part").exists()


def test_folders_of_others_are_left_alone(tmp_path):
    (tmp_path / "hits.npz.part").mkdir()
    (tmp_path / "hits.npz.part" / "mine").write_text("mine")
    with pytest.raises(FileExistsError, match="is in the way"):
        trace(tmp_path, resume=True)
    (tmp_path / "hits").mkdir()
    (tmp_path / "hits" / "mine").write_text("mine")
    with pytest.raises(FileExistsError, match="exists: choose another name"):
        trace(tmp_path, "hits/")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(FileExistsError, match="exists: choose another name"):
        trace(tmp_path, "file/")
    assert (tmp_path / "hits.npz.part" / "mine").read_text() == "mine"
    assert sorted(path.name for path in (tmp_path / "hits").iterdir()) == ["mine"]


@pytest.mark.parametrize("output", ["hits.npz", "hits/"])
def test_a_folder_of_others_beside_a_complete_output_is_left_alone(tmp_path, output):
    trace(tmp_path, output)
    part = tmp_path / f"{output.rstrip('/')}.part"
    part.mkdir()
    (part / "mine").write_text("mine")
    with pytest.raises(FileExistsError, match="is in the way"):
        trace(tmp_path, output, resume=True)
    assert (part / "mine").read_text() == "mine"


def test_ctrl_c_before_a_folder_is_looked_into_leaves_what_others_have_there(tmp_path, monkeypatch):
    (tmp_path / "hits.npz.part").mkdir()
    (tmp_path / "hits.npz.part" / "mine").write_text("mine")

    def interrupted(folder):
        raise KeyboardInterrupt

    monkeypatch.setattr(hit_files, "unfinished", interrupted)
    with pytest.raises(KeyboardInterrupt):
        trace(tmp_path)
    assert (tmp_path / "hits.npz.part" / "mine").read_text() == "mine"


def test_two_runs_don_t_write_one_output(tmp_path):
    name, _ = write_rays("npy", tmp_path, some_rays())
    scene = small_scene()

    def second(done, total):
        if done == total:
            return
        with pytest.raises(OSError, match="another run is writing there"):
            wive.trace(scene, name, tmp_path / "hits.npz", resume=True)

    wive.trace(scene, name, tmp_path / "hits.npz", piece=500, progress=second)


def test_an_output_that_is_replaced_keeps_its_mode(tmp_path):
    (tmp_path / "hits.npz").write_bytes(b"old")
    (tmp_path / "hits.npz").chmod(0o640)
    trace(tmp_path)
    assert (tmp_path / "hits.npz").stat().st_mode & 0o777 == 0o640
    assert len(arrays_of(tmp_path / "hits.npz")["t"]) == COUNT


@pytest.mark.parametrize("lost", [1, 2, 5, 6])
def test_what_the_disk_lost_is_traced_again(tmp_path, monkeypatch, lost):
    """A system tells of a lost write once, by an error of fsync; later calls succeed."""
    trace(tmp_path, "whole.npz")
    flush, folder, left, kept = os.fsync, tmp_path / "hits.npz.part", lost, -1

    def failing(file):
        nonlocal left, kept
        left -= 1
        if left == 0:
            state = folder / "state.json"
            kept = json.loads(state.read_bytes())["done"] if state.exists() else 0
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        flush(file)

    monkeypatch.setattr(hit_files, "CHECKPOINT", 0)
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", failing)
        with pytest.raises(OSError, match=r"hits\.npz"):
            trace(tmp_path, progress=lambda done, total: time.sleep(0.02))
    assert kept >= 0
    assert trace(tmp_path, resume=True).resumed == kept
    assert content_of(tmp_path / "hits.npz") == content_of(tmp_path / "whole.npz")


def test_output_is_brought_to_the_disk_while_rays_are_traced(tmp_path, monkeypatch):
    flush, flushed = os.fsync, []

    def told(file):
        flushed.append(os.fstat(file).st_size)
        flush(file)

    monkeypatch.setattr(hit_files, "FLUSHED", 1)
    monkeypatch.setattr(os, "fsync", told)
    in_time = []
    trace(tmp_path, progress=lambda done, total: (time.sleep(0.02), in_time.append(len(flushed))))
    assert in_time[0] <= 1 and in_time[-2] > 3


def test_an_interrupted_run_of_another_form_is_refused(tmp_path):
    interrupt(tmp_path)
    name = tmp_path / "hits.npz.part" / "state.json"
    state = json.loads(name.read_bytes())
    del state["about"]["record"]
    name.write_text(json.dumps(state))
    with pytest.raises(ValueError, match="was of another version of wive: give the same, delete it"):
        trace(tmp_path, resume=True)
    assert name.exists()


KILLED = """
import sys, time, wive
from wive._internal import hit_files, progress
hit_files.CHECKPOINT = progress.PERIOD = 0
slowly = lambda done, total: time.sleep(0.02)
wive.trace(wive.load("scene.wive"), "rays.npy", sys.argv[1], query=sys.argv[2], piece=20, progress=slowly)
"""


@pytest.mark.parametrize(("output", "query"), [("hits.npz", "intersect"), ("hits.npz", "intersect_all")])
def test_a_killed_run_goes_on(tmp_path, output, query):
    trace(tmp_path, "whole.npz", query)
    shutil.copy(tmp_path / "rays.npy", tmp_path / "same.npy")
    small_scene().save(tmp_path / "scene.wive")
    process = subprocess.Popen([sys.executable, "-c", KILLED, output, query], cwd=tmp_path)
    state = tmp_path / "hits.npz.part" / "state.json"
    end = time.monotonic() + 60
    while not state.exists() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.001)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not (tmp_path / output).exists()
    done = trace(tmp_path, output, query, resume=True)
    assert 0 < done.resumed < COUNT
    assert content_of(tmp_path / output) == content_of(tmp_path / "whole.npz")
