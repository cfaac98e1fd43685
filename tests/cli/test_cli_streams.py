"""`wive trace` of files that don't fit into memory: forms of rays and outputs, interruptions, progress."""

import errno
import os

import numpy as np
import pytest
from support.ray_files import COUNT, FORMS, arrays_of, content_of, small_scene, some_rays, write_rays

from wive._internal import hit_columns
from wive.cli import main


@pytest.fixture
def folder(tmp_path, monkeypatch):
    small_scene().save(tmp_path / "soup.wive")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def trace(*options: object) -> int:
    return main(["trace", "soup.wive", *map(str, options)])


def options_of(given: dict[str, object]) -> list[object]:
    return [part for name, value in given.items() for part in (f"--{name}", value)]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("output", ["hits.npz", "hits/"])
def test_trace_reads_every_form_of_rays(folder, capfd, form, output):
    name, given = write_rays(form, folder, some_rays())
    assert trace(name, "-o", output, "--piece", 100, *options_of(given)) == 0
    said = capfd.readouterr()
    assert said.err == ""  # no bar: it is no terminal
    assert "1,003 rays in" in said.out and "Mray/s" in said.out
    expected = small_scene().intersect(*some_rays())
    for key, array in arrays_of(folder / output).items():
        np.testing.assert_array_equal(array, getattr(expected, key))


@pytest.mark.parametrize("option", [(), ("--all",)])
@pytest.mark.parametrize("writes", [7, 20, 32])
def test_ctrl_c_in_mid_write_keeps_what_is_done(folder, capsys, monkeypatch, option, writes):
    name, _ = write_rays("npy", folder, some_rays())
    assert trace(name, "-o", "whole.npz", *option) == 0
    write, left = hit_columns._write_at, writes

    def interrupted(file, data, place):
        nonlocal left
        left -= 1
        if left == 0:
            write(file, data[: len(data) // 2], place)
            raise KeyboardInterrupt
        write(file, data, place)

    command = name, "-o", "hits.npz", *option, "--piece", 100
    with monkeypatch.context() as patched:
        patched.setattr(hit_columns, "_write_at", interrupted)
        assert trace(*command) == 130
    error = capsys.readouterr().err
    assert error.startswith("wive: interrupted: ") and error.count("\n") == 1
    assert "of 1,003 rays are kept in" in error and "resume to go on" in error
    assert not (folder / "hits.npz").exists()
    assert trace(*command) == 2
    assert "of an interrupted run: resume it, or delete the folder" in capsys.readouterr().err
    assert trace(*command, "--resume") == 0
    assert " before, " in capsys.readouterr().out
    assert content_of(folder / "hits.npz") == content_of(folder / "whole.npz")
    assert trace(*command, "--resume") == 0
    assert f"complete already, {COUNT:,} rays" in capsys.readouterr().out


def test_a_full_disk_is_one_line(folder, capsys, monkeypatch):
    name, _ = write_rays("npy", folder, some_rays())

    def full(file, begin, size):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    before = sorted(folder.iterdir())
    assert trace(name, "-o", "hits.npz") == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "No space left on device, nothing was written" in error
    assert sorted(folder.iterdir()) == before


def test_a_folder_of_hits_is_complete_or_in_the_way_but_no_part_of_the_mesh(folder, capsys):
    write_rays("npy", folder, some_rays())
    command = "rays.npy", "-o", "hits/"
    assert trace(*command) == 0
    before = content_of(folder / "hits")
    assert trace(*command) == 2
    assert "output folder 'hits/' exists" in capsys.readouterr().err
    assert trace(*command, "--resume") == 0
    assert f"complete already, {COUNT:,} rays" in capsys.readouterr().out
    assert content_of(folder / "hits") == before


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("rays.npy", "-o", "rays.npy/"), "exists: choose another name"),
        (("rays.npy", "-o", "no/hits/"), "output folder"),
        (("rays.npy", "-o", "hits.npz", "--piece", "0"), "piece must be"),
        (("rays.npy", "-o", "hits.npz", "--columns", "ox"), "columns is only for raw files"),
        (("rays.npy", "-o", "hits.npz", "--raw", "text"), "dtype of raw rays must be"),
        (("rays.npy", "-o", "hits.npz", "--raw", "f8"), "rays.npy: not a file of raw rays"),
        (("-", "-o", "hits.npz"), "-: no such file"),
        (("/dev/stdin", "-o", "hits.npz"), "/dev/stdin"),
    ],
)
def test_what_can_t_be_done_is_one_line_and_leaves_nothing(folder, capsys, arguments, text):
    write_rays("npy", folder, some_rays())
    before = sorted(folder.rglob("*"))
    assert trace(*arguments) == 2
    error = capsys.readouterr().err
    assert text in error and error.count("\n") == 1
    assert sorted(folder.rglob("*")) == before
