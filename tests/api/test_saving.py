"""Written files are whole or as they were, keep mode, owner and links, and are named in errors."""

import errno
import os
import signal
import stat
import subprocess
import sys

import numpy as np
import pytest
from support.meshes import TRIANGLE, random_rays, sphere

import wive
from wive._internal import files
from wive.cli import main
from wive.rendering import write_png

ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


def save_scene(path) -> None:
    wive.Scene(*TRIANGLE).save(path)


def save_picture(path) -> None:
    pytest.importorskip("PIL")
    write_png(path, np.zeros((4, 4, 3), np.float32))


def save_hits(path) -> None:
    folder = path.parent / "inputs"
    folder.mkdir(exist_ok=True)
    np.savez(folder / "mesh.npz", vertices=TRIANGLE[0], faces=TRIANGLE[1])
    np.save(folder / "rays.npy", np.concatenate(random_rays(5, seed=1), axis=1))
    assert main(["trace", str(folder / "mesh.npz"), str(folder / "rays.npy"), "-o", str(path)]) == 0


def test_a_saved_scene_does_not_pass_for_a_mesh_file(tmp_path):
    scene = wive.Scene(*TRIANGLE)
    for name in ("part.ply", "PART.STL", "scene.glb"):
        with pytest.raises(
            ValueError, match=r"^path must not end as mesh files do, got .*: name a saved scene \.wive$"
        ):
            scene.save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


WRITERS = {"scene.wive": save_scene, "picture.png": save_picture, "hits.npz": save_hits}


@pytest.fixture(params=WRITERS)
def output(request, tmp_path):
    """A path to write to, and what writes there."""
    return tmp_path / request.param, WRITERS[request.param]


def mode_of(path) -> int:
    return stat.S_IMODE(os.stat(path).st_mode)


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o644, 0o666, 0o755, 0o660])
def test_a_replaced_file_keeps_its_mode(output, mode):
    path, write = output
    path.write_bytes(b"old")
    path.chmod(mode)
    write(path)
    assert mode_of(path) == mode
    assert path.read_bytes() != b"old"


@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002])
def test_a_new_file_has_the_mode_of_new_files(output, umask):
    path, write = output
    before = os.umask(umask)
    try:
        write(path)
    finally:
        os.umask(before)
    assert mode_of(path) == 0o666 & ~umask


@pytest.mark.skipif(not ROOT, reason="only root gives files away")
def test_a_replaced_file_keeps_its_owner(output):
    path, write = output
    path.write_bytes(b"old")
    path.chmod(0o640)
    os.chown(path, 1234, 2345)
    write(path)
    found = os.stat(path)
    assert (found.st_uid, found.st_gid, mode_of(path)) == (1234, 2345, 0o640)


def test_a_group_that_can_not_be_kept_gives_its_rights_to_nobody(tmp_path, monkeypatch):
    """Another group than the old file's must not read what only the old one could."""
    path = tmp_path / "scene"
    path.write_bytes(b"old")
    path.chmod(0o4664)

    def refuse(*arguments: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    owned = os.stat(path)
    monkeypatch.setattr(os, "fchown", refuse)
    fields = list(owned)
    fields[4:6] = owned.st_uid + 1, owned.st_gid + 1
    monkeypatch.setattr(files, "_status", lambda name: os.stat_result(fields) if name == str(path) else None)
    save_scene(path)
    monkeypatch.undo()
    assert mode_of(path) == 0o644


def test_nobody_else_reads_a_private_file_while_it_is_written(tmp_path):
    path = tmp_path / "scene"
    path.write_bytes(b"old")
    path.chmod(0o600)
    with files.atomic_write(path) as file:
        file.write(b"new")
        (part,) = (name for name in tmp_path.iterdir() if name != path)
        assert mode_of(part) == 0o600
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("exists", [True, False])
def test_a_symbolic_link_stays_and_its_target_is_written(output, exists):
    path, write = output
    target = path.parent / "elsewhere" / path.name
    target.parent.mkdir()
    if exists:
        target.write_bytes(b"old")
        target.chmod(0o640)
    path.symlink_to(os.path.join("elsewhere", path.name))
    write(path)
    assert path.is_symlink()
    assert target.read_bytes() not in (b"", b"old")
    assert mode_of(target) == (0o640 if exists else mode_of(path))


def test_links_to_themselves_are_refused(tmp_path):
    (tmp_path / "one").symlink_to("two")
    (tmp_path / "two").symlink_to("one")
    with pytest.raises(ValueError, match=r"^output file '.*' is a symbolic link to itself"):
        save_scene(tmp_path / "one")


@pytest.mark.parametrize(
    ("name", "kind", "expected"),
    [
        ("x" * 300, OSError, "File name too long"),
        ("", ValueError, "path must be a file name, got ''"),
        ("a\0b", ValueError, r"path must be a file name, got 'a\x00b'"),
        (5, TypeError, "path must be a file name, got int 5"),
        (None, TypeError, "path must be a file name, got NoneType None"),
        ("/dev/full", ValueError, "output file '/dev/full' exists and is not an ordinary file"),
        ("/dev/null/x", FileNotFoundError, "output folder '/dev/null' does not exist"),
    ],
)
def test_a_name_that_can_not_be_written_to(tmp_path, monkeypatch, name, kind, expected):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(kind) as error:
        save_scene(name)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("protected", ["folder", "file"])
def test_a_protected_place_is_named_before_anything_is_written(tmp_path, monkeypatch, protected):
    path = tmp_path / "scene"
    path.write_bytes(b"old")
    there = str(tmp_path if protected == "folder" else path)
    monkeypatch.setattr(os, "access", lambda name, mode: str(name) != there)  # root may write anywhere
    with pytest.raises(PermissionError, match=r"is not writable|is write-protected"):
        save_scene(path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


LIMITED = """
import resource, signal, sys
import numpy as np, wive
from wive.cli import main
from wive.rendering import write_png
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
r = np.random.default_rng(0)
v = r.random((3000, 3)).astype("f4"); f = np.arange(3000, dtype="i4").reshape(-1, 3)
np.savez("mesh.npz", vertices=v, faces=f); np.save("rays.npy", r.random((3000, 6)))
picture = r.random((100, 100, 3)).astype("f4")
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))
for name, write in (("scene", wive.Scene(v, f).save), ("picture.png", lambda path: write_png(path, picture))):
    try:
        write(name)
    except OSError as error:
        print(error)
print(main(["trace", "mesh.npz", "rays.npy", "-o", "hits.npz"]))
"""


def test_a_disk_that_is_full_names_the_file_and_leaves_the_old_one(tmp_path):
    """A limit on the size of files fails as a full disk does: in the middle of writing."""
    for name in ("scene", "picture.png", "hits.npz"):
        (tmp_path / name).write_bytes(b"old")
    pytest.importorskip("PIL")
    ran = subprocess.run([sys.executable, "-c", LIMITED], cwd=tmp_path, capture_output=True, text=True)
    reason = f"[Errno {errno.EFBIG}] File too large, nothing was written"
    assert ran.stdout.splitlines() == [f"{reason}: 'scene'", f"{reason}: 'picture.png'", "2"], ran.stderr
    assert ran.stderr.splitlines()[-1] == f"wive: error: {reason}: 'hits.npz'"
    for name in ("scene", "picture.png", "hits.npz"):
        assert (tmp_path / name).read_bytes() == b"old"
    assert {path.name for path in tmp_path.iterdir()} == {
        *("scene", "picture.png", "hits.npz"),
        *("mesh.npz", "rays.npy"),
    }


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_system_that_fails_late_leaves_the_old_file(output, monkeypatch, number, call):
    path, write = output
    write(path)
    whole = path.read_bytes()
    before = sorted(path.parent.iterdir())

    def fail(*arguments: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, fail)
    if path.suffix == ".npz":
        with pytest.raises(AssertionError):
            write(path)
    else:
        with pytest.raises(OSError) as error:
            write(path)
        assert error.value.errno == number
        assert error.value.filename == str(path)
    assert path.read_bytes() == whole
    assert sorted(path.parent.iterdir()) == before


def test_ctrl_c_while_writing_leaves_the_old_file(output, monkeypatch):
    path, write = output
    write(path)
    whole = path.read_bytes()

    sent: list[bool] = []

    def interrupt(*arguments: object) -> None:
        if not sent:  # a thread that brings files to the disk calls it again, maybe after the end
            sent.append(True)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(os, "fsync", interrupt)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        if path.suffix == ".npz":
            with pytest.raises(AssertionError):
                write(path)
        else:
            with pytest.raises(KeyboardInterrupt):
                write(path)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert path.read_bytes() == whole
    assert not list(path.parent.glob(".*"))


def test_pieces_are_written_as_one_array(tmp_path):
    np.savez(tmp_path / "mesh.npz", **dict(zip(("vertices", "faces"), sphere(2), strict=True)))
    rays = random_rays(100, seed=2)
    np.save(tmp_path / "rays.npy", np.concatenate(rays, axis=1))
    paths = [str(tmp_path / name) for name in ("mesh.npz", "rays.npy", "hits.npz")]
    assert main(["trace", *paths[:2], "-o", paths[2], "--all", "--piece", "7"]) == 0
    expected = wive.Scene(*sphere(2)).intersect_all(*rays)
    with np.load(paths[2]) as hits:
        for name in ("t", "prim", "uv", "offsets"):
            np.testing.assert_array_equal(hits[name], getattr(expected, name))
            assert hits[name].dtype == getattr(expected, name).dtype
