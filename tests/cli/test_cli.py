"""The command line, called as a function and as a program."""

import contextlib
import fcntl
import os
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time

import numpy as np
import pytest
from support.gltf_files import compressed
from support.meshes import random_rays, sphere

import wive
from wive.cli import main

NO_RAYS = "not a file of rays, (n,6) or (n,8) in an .npy or `origins` and `directions` in an .npz: "


@pytest.fixture
def ball(tmp_path):
    vertices, faces = sphere(3)
    np.savez(tmp_path / "ball.npz", vertices=vertices, faces=faces)
    return tmp_path / "ball.npz"


def run(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


def one_error(capsys) -> str:
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith("wive: error: ")
    assert output.err.count("\n") == 1
    return output.err.removeprefix("wive: error: ").rstrip("\n")


def test_render_writes_a_picture_and_prints_rays_per_second(ball, tmp_path, capsys):
    pillow = pytest.importorskip("PIL.Image")
    picture = tmp_path / "ball.png"
    assert (
        run("render", ball, "-o", picture, "--width", 60, "--height", 40, "--spp", 2, "--backend", "scalar")
        == 0
    )
    line = capsys.readouterr().out
    assert line.startswith(f"{picture}: ")
    assert "Mray/s, scalar, 1,280 triangles" in line
    assert line.count("\n") == 1
    with pillow.open(picture) as image:
        assert image.size == (60, 40)
        assert len(set(image.convert("L").tobytes())) > 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ball.npz", "ball.png"]


def test_render_without_a_mesh_draws_terrain_into_the_current_folder(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    pillow = pytest.importorskip("PIL.Image")
    monkeypatch.chdir(tmp_path)
    assert run("render", "--width", 64, "--height", 36, "--spp", 1) == 0
    assert "275,772 triangles" in capsys.readouterr().out
    with pillow.open("wive.png") as image:
        pixels = np.asarray(image.convert("L"))
    assert (pixels < 255).mean() > 0.5
    assert pixels.std() > 10


def test_render_takes_a_camera(ball, tmp_path):
    pillow = pytest.importorskip("PIL.Image")
    small = ("--width", 32, "--height", 32, "--spp", 1, "--sky", "white")
    away = ("--eye", 0, 0, -5, "--target", 0, 0, -9, "--up", 0, 1, 0, "--fov", 50)
    assert run("render", ball, "-o", tmp_path / "away.png", *small, *away) == 0
    with pillow.open(tmp_path / "away.png") as image:
        assert set(image.tobytes()) == {255}


@pytest.mark.parametrize("form", ["six", "eight", "npz"])
def test_trace_writes_the_hits_of_the_library(ball, tmp_path, capsys, form):
    origins, directions = random_rays(1003, seed=1)
    limits = (
        () if form == "six" else (np.full(1003, 0.1, np.float32), np.linspace(0, 3, 1003, dtype=np.float32))
    )
    if form == "npz":
        rays = tmp_path / "rays.npz"
        np.savez(rays, origins=origins, directions=directions, tmin=limits[0], tmax=limits[1])
    else:
        rays = tmp_path / "rays.npy"
        np.save(rays, np.column_stack([origins, directions, *limits]))
    assert run("trace", ball, rays, "-o", tmp_path / "hits.npz", "--threads", 2, "--piece", 100) == 0
    expected = wive.Scene.from_file(ball).intersect(origins, directions, *limits)
    assert "1,003 rays in" in capsys.readouterr().out
    with np.load(tmp_path / "hits.npz") as hits:
        np.testing.assert_array_equal(hits["t"], expected.t)
        np.testing.assert_array_equal(hits["prim"], expected.prim)
        np.testing.assert_array_equal(hits["uv"], expected.uv)


def test_rays_from_far_away_are_brought_near_before_they_are_rounded(ball, tmp_path):
    random = np.random.default_rng(1)
    targets, directions = random.uniform(-0.5, 0.5, (50, 3)), random.standard_normal((50, 3))
    np.savez(tmp_path / "rays.npz", origins=targets - 1e7 * directions, directions=directions)
    assert run("trace", ball, tmp_path / "rays.npz", "-o", tmp_path / "hits.npz") == 0
    with np.load(tmp_path / "hits.npz") as hits:
        assert (hits["prim"] >= 0).all()
        np.testing.assert_allclose(hits["t"], 1e7, rtol=1e-6)


def test_info_describes_mesh_and_tree(ball, capsys):
    assert run("info", ball, "--accuracy", "fast", "--backend", "scalar") == 0
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert lines["triangles"] == "1,280"
    assert lines["backend"] == "scalar"
    assert lines["accuracy"] == "fast"
    assert int(lines["nodes"]) > 20
    assert 2 <= int(lines["depth"]) < 30
    assert lines["memory"].endswith("per triangle)")


def test_info_names_the_node_form(ball, capsys):
    sizes = []
    for nodes in ("float32", "compressed"):
        assert run("info", ball, "--nodes", nodes) == 0
        lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
        assert lines["form"] == f"{nodes} nodes"
        sizes.append(int(lines["memory"].split()[0].replace(",", "")))
    assert sizes[1] < 0.65 * sizes[0]


def test_backends_lists_each_with_its_reason(capsys):
    assert run("backends") == 0
    lines = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in lines if not line.startswith(" ")]
    assert names == list(wive.backends())
    assert "usable" in lines[2]
    form = wive.backends()["avx512"].form
    assert lines[0].endswith(f"{form} form" if form else wive.backends()["avx512"].reason)
    devices = [line.split()[0] for line in lines if line.startswith(" ")]
    assert devices == list(wive.backends()["warp"].devices)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("render", "{tmp}/no.stl"), "{tmp}/no.stl: no such file"),
        (
            ("render", "{ball}", "-o", "{tmp}/x.jpg"),
            "output file must end in .png, .exr, .hdr, .npy, .tif or .tiff, got '{tmp}/x.jpg'",
        ),
        (
            ("render", "{ball}", "-o", "{tmp}/no/x.png"),
            "output folder '{tmp}/no' does not exist: create it first",
        ),
        (("render", "{ball}", "--spp", "0"), "spp must be from 1 to 2147483647, got 0"),
        (("render", "{ball}", "--width", "-5"), "width must be from 1 to 65536, got -5"),
        (
            ("render", "{ball}", "--eye", "0", "0", "5", "--target", "0", "0", "5"),
            "eye and target must differ, got [0.0, 0.0, 5.0] for both",
        ),
        (("render", "{ball}", "--fov", "0"), "fov must be between 0 and 180 degrees, got 0"),
        (
            ("render", "{ball}", "--backend", "gpu"),
            "backend must be one of auto, avx512, avx2, scalar, warp in this version of wive, got 'gpu': "
            "device 'cuda:0' is the first GPU",
        ),
        (
            ("render", "{ball}", "--device", "cuda:0", "--backend", "scalar"),
            "device is only for backend 'warp', got device 'cuda:0' with backend 'scalar': "
            "leave one of them out",
        ),
        (
            ("info", "{ball}", "--accuracy", "precise"),
            "accuracy must be one of fast, watertight, exact in this version of wive, got 'precise'",
        ),
        (("trace", "{ball}", "{tmp}/no.npy", "-o", "{tmp}/hits.npz"), "{tmp}/no.npy: no such file"),
        (
            ("trace", "{ball}", "{ball}", "-o", "{tmp}/hits.npy"),
            "output file must end in .npz, got '{tmp}/hits.npy'",
        ),
        (
            ("trace", "{ball}", "{ball}", "-o", "{tmp}/hits.npz"),
            "{ball}: " + NO_RAYS + "found arrays faces, vertices",
        ),
        (
            ("trace", "{ball}", "{seven}", "-o", "{tmp}/hits.npz"),
            "{seven}: " + NO_RAYS + "found shape (5, 7)",
        ),
        (
            ("trace", "{ball}", "{complex}", "-o", "{tmp}/hits.npz"),
            "{complex}: origins must be an (n, 3) array of real numbers, "
            "got dtype complex128: convert it first",
        ),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_file(ball, tmp_path, monkeypatch, capsys, arguments, expected):
    monkeypatch.chdir(tmp_path)
    names = {
        "ball": ball,
        "tmp": tmp_path,
        "seven": tmp_path / "seven.npy",
        "complex": tmp_path / "complex.npy",
    }
    np.save(names["seven"], np.zeros((5, 7)))
    np.save(names["complex"], np.zeros((5, 6), complex))
    before = sorted(tmp_path.iterdir())
    assert run(*(argument.format(**names) for argument in arguments)) == 2
    assert one_error(capsys) == expected.format(**names)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((), "the following arguments are required: COMMAND (see wive --help)"),
        (("render", "--spp", "many"), "argument --spp: invalid int value: 'many' (see wive render --help)"),
        (
            ("trace", "mesh"),
            "the following arguments are required: RAYS, -o/--output (see wive trace --help)",
        ),
    ],
)
def test_bad_usage_is_one_line(capsys, arguments, expected):
    with pytest.raises(SystemExit) as leaving:
        run(*arguments)
    assert leaving.value.code == 2
    assert one_error(capsys) == expected


@pytest.mark.parametrize(
    ("package", "arguments", "extra"),
    [
        ("PIL", ("render",), "render"),
        ("matplotlib", ("render",), "render"),
        ("DracoPy", ("info", "{tmp}/mesh.glb"), "draco"),
    ],
)
def test_a_missing_package_is_named_with_the_extra_that_brings_it(
    tmp_path, monkeypatch, capsys, package, arguments, extra
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mesh.glb").write_bytes(compressed().glb())
    for name in [package, *(name for name in sys.modules if name.startswith(f"{package}."))]:
        monkeypatch.setitem(sys.modules, name, None)
    assert run(*(argument.format(tmp=tmp_path) for argument in arguments)) == 2
    assert f'pip install "wive[{extra}]"' in one_error(capsys)
    assert not (tmp_path / "wive.png").exists()


def test_a_picture_too_large_for_memory_is_one_line(ball, tmp_path, capsys, monkeypatch):
    def no_memory(*arguments: object) -> None:
        raise MemoryError("Unable to allocate 48.0 GiB")

    monkeypatch.setattr(np, "zeros", no_memory)
    assert run("render", ball, "-o", tmp_path / "x.png") == 2
    assert one_error(capsys) == "Unable to allocate 48.0 GiB"


def test_a_failed_picture_leaves_the_old_one(ball, tmp_path, capsys, monkeypatch):
    picture = tmp_path / "x.png"
    picture.write_bytes(b"old")
    image = pytest.importorskip("PIL.Image")

    def half_saved(self, file, **options) -> None:
        file.write(b"half")
        raise OSError("no space left")

    monkeypatch.setattr(image.Image, "save", half_saved)
    assert run("render", ball, "-o", picture, "--width", 8, "--height", 8, "--spp", 1) == 2
    assert capsys.readouterr().err.endswith("wive: error: no space left\n")
    assert picture.read_bytes() == b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ball.npz", "x.png"]


# Python first looks for modules in the working folder; the repository's source folder has no core.
ELSEWHERE = tempfile.gettempdir()


WIVE = sys.executable, "-m", "wive"


def program(*arguments: object, **options) -> subprocess.Popen[str]:
    command = [*WIVE, *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, text=True, cwd=ELSEWHERE, **pipes, **options)


def test_the_program_succeeds_and_fails_by_exit_status(tmp_path):
    good = program("backends")
    output, errors = good.communicate(timeout=30)
    assert set(wive.backends()) <= set(output.split())
    assert errors == ""
    assert good.returncode == 0
    bad = program("info", tmp_path / "no.stl")
    assert bad.communicate(timeout=30) == ("", f"wive: error: {tmp_path}/no.stl: no such file\n")
    assert bad.returncode == 2


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
def test_output_that_can_not_be_printed_is_an_error(ball):
    with open("/dev/full", "wb") as full:
        command = [sys.executable, "-m", "wive", "info", str(ball)]
        ran = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=ELSEWHERE)
    assert ran.stderr == "wive: error: [Errno 28] No space left on device: 'standard output'\n"
    assert ran.returncode == 2


def test_a_reader_that_leaves_ends_the_program_silently(ball):
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "wive", "info", str(ball)]
    ran = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, cwd=ELSEWHERE)
    os.close(writing)
    assert ran.stderr == ""
    assert ran.returncode == 141


def test_ctrl_c_ends_a_long_render_with_130_and_no_file(ball, tmp_path):
    terminal, errors_to = os.openpty()  # elsewhere there are no bars
    fcntl.ioctl(errors_to, termios.TIOCSWINSZ, struct.pack("4H", 24, 100, 0, 0))
    process = subprocess.Popen(
        [*WIVE, "render", str(ball), "-o", str(tmp_path / "x.png"), "--spp", "2000", "--width", "400"],
        stdout=subprocess.PIPE,
        stderr=errors_to,
        cwd=ELSEWHERE,
        # A shell that runs the tests in the background may have made them ignore the signal.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    os.close(errors_to)
    errors = ""
    try:
        while "rendering" not in errors:
            errors += os.read(terminal, 1000).decode()
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=20)
        with contextlib.suppress(OSError):  # at the end of what was written to a terminal
            while more := os.read(terminal, 1000).decode():
                errors += more
    finally:
        process.kill()
        os.close(terminal)
    assert process.returncode == 130
    assert output == b""
    assert errors.endswith("wive: interrupted\r\n")
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == [ball]


@pytest.mark.parametrize("command", ["render", "trace", "info"])
def test_help_shows_each_default_once_and_none_that_is_nothing(capsys, command):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert "(default: auto)" in text
    assert "None" not in text and "False" not in text
    assert command != "render" or "of the random numbers (default: 0)" in text


@pytest.mark.parametrize("options", [("--threads", "0"), ("--all", "--max-bytes", "0")])
def test_bad_options_are_refused_before_the_progress_bar(ball, tmp_path, capsys, options):
    np.save(tmp_path / "rays.npy", np.zeros((1, 6)))
    assert (
        main(["trace", str(ball), str(tmp_path / "rays.npy"), "-o", str(tmp_path / "o.npz"), *options]) == 2
    )
    error = capsys.readouterr().err
    assert error.startswith("wive: error: ") and error.count("\n") == 1


def test_a_flat_mesh_is_seen_from_above_without_an_up(tmp_path, capsys):
    pytest.importorskip("PIL")
    np.savez(tmp_path / "flat.npz", vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]])
    command = ["render", str(tmp_path / "flat.npz"), "-o", str(tmp_path / "o.png"), "--target", "0", "0", "0"]
    small = ["--width", "8", "--height", "8", "--spp", "1"]
    assert main([*command, *small, "--eye", "0", "0", "5"]) == 0
    capsys.readouterr()
    for eye, expected in (("inf", "eye must be finite"), ("0", "eye and target must differ")):
        assert main([*command, *small, "--eye", "0", "0", eye]) == 2
        assert capsys.readouterr().err.startswith(f"wive: error: {expected}")
