"""The device that a scene traces on: chosen, kept, listed, refused in one line."""

import pickle
import subprocess
import sys
import tempfile

import numpy as np
import pytest
from support.meshes import TRIANGLE, assert_same_hits, random_rays, soup, sphere

import wive
from wive._internal import devices
from wive.cli import main

pytest.importorskip("warp")

NO_DRIVER = "no NVIDIA driver found: install one, on a machine with an NVIDIA GPU"


@pytest.fixture
def only_cpu(monkeypatch):
    """A machine without a GPU."""
    monkeypatch.setattr(devices, "warp_devices", lambda: {"cuda:0": NO_DRIVER, "cpu": ""})


def message(error: pytest.ExceptionInfo[Exception]) -> str:
    text = str(error.value)
    assert "\n" not in text
    return text


def test_a_device_alone_implies_backend_warp(device):
    scene = wive.Scene(*TRIANGLE, device=device)
    assert (scene.backend, scene.device) == ("warp", device)
    assert scene.tree.accuracy == "watertight"
    assert scene.tree.device.alias == device


def test_backend_warp_alone_takes_the_first_usable_device(monkeypatch, device):
    assert wive.Scene(*TRIANGLE, backend="warp").device == device
    monkeypatch.setattr(devices, "warp_devices", lambda: {"cuda:0": "", "cuda:1": "", "cpu": ""})
    assert wive.backend.resolve_backend("warp") == ("warp", "cuda:0")
    assert wive.backend.resolve_backend("auto", "cuda:1") == ("warp", "cuda:1")
    assert wive.backend.resolve_backend("warp", "cuda") == ("warp", "cuda:0")
    assert wive.backend.resolve_backend("warp", "cpu") == ("warp", "cpu")


def test_auto_without_a_device_never_takes_warp(usable_backends):
    scene = wive.Scene(*TRIANGLE)
    assert scene.backend == usable_backends[0] != "warp"
    assert scene.device is None
    with pytest.raises(ValueError) as error:
        _ = scene.tree
    assert message(error) == (
        f"tree is for scenes with backend 'warp', this one has {scene.backend!r}: "
        "make it with device='cpu' or device='cuda:0'"
    )


def test_every_lane_form_returns_the_same_bits(device):
    scene = wive.Scene(*soup(300, seed=1), device=device)
    rays = random_rays(333, seed=2, low=-0.5, high=1.5)
    expected, blocked = scene.intersect(*rays), scene.occluded(*rays)
    assert expected.mask.any()
    for lanes in (1, 8, "auto"):
        assert_same_hits(scene.intersect(*rays, lanes=lanes), expected)
        np.testing.assert_array_equal(scene.occluded(*rays, lanes=lanes), blocked)


def test_lanes_are_chosen_by_device_and_number_of_rays():
    from wive.warp_kernels.scene.tracer import EIGHT_THREADS_BELOW, choose_lanes

    assert choose_lanes(None, 1, on_cuda=True) == 1
    assert choose_lanes(None, EIGHT_THREADS_BELOW - 1, on_cuda=True) == 1
    assert choose_lanes(None, EIGHT_THREADS_BELOW, on_cuda=True) == 8
    assert choose_lanes(None, 1, on_cuda=False) == 8
    assert choose_lanes(1, 10**6, on_cuda=False) == 1


def test_saved_and_pickled_scenes_keep_their_device(tmp_path, device):
    scene = wive.Scene(*soup(200, seed=3), device=device, accuracy="fast")
    rays = random_rays(500, seed=4, low=0, high=1)
    scene.save(tmp_path / "scene")
    for again in (wive.load(tmp_path / "scene"), pickle.loads(pickle.dumps(scene))):
        assert (again.backend, again.device, again.accuracy) == ("warp", device, "fast")
        assert_same_hits(again.intersect(*rays), scene.intersect(*rays))


@pytest.mark.usefixtures("only_cpu")
def test_a_scene_of_another_machines_device_opens_on_the_requested_one(
    tmp_path, monkeypatch, usable_backends
):
    wive.Scene(*TRIANGLE, device="cpu").save(tmp_path / "warp.npz")
    with np.load(tmp_path / "warp.npz") as arrays:
        content = dict(arrays)
    content["header"] = np.array(str(content["header"]).replace('"device": "cpu"', '"device": "cuda:0"'))
    with open(tmp_path / "cuda.npz", "wb") as file:
        np.savez(file, **content)
    with pytest.raises(ValueError) as error:
        wive.load(tmp_path / "cuda.npz")
    assert message(error) == (
        f"{tmp_path / 'cuda.npz'}: device 'cuda:0' can't be used here ({NO_DRIVER}); choose one of cpu"
    )
    assert wive.load(tmp_path / "cuda.npz", device="cpu").device == "cpu"
    assert wive.load(tmp_path / "cuda.npz", backend="auto").backend == usable_backends[0]
    assert wive.load(tmp_path / "cuda.npz", backend="scalar").device is None


def test_backends_list_each_device_with_its_reason(monkeypatch):
    found = wive.backends()["warp"].devices
    assert found["cpu"].usable
    for listed in found.values():
        assert listed.usable == (listed.reason == "")
    monkeypatch.setattr(wive.backend, "warp_devices", lambda: {"cuda:0": NO_DRIVER, "cpu": ""})
    assert wive.backends()["warp"].devices == {
        "cuda:0": wive.Backend(usable=False, reason=NO_DRIVER),
        "cpu": wive.Backend(usable=True),
    }


@pytest.mark.usefixtures("only_cpu")
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("cuda:0", f"device 'cuda:0' can't be used here ({NO_DRIVER}); choose one of cpu"),
        ("cuda", f"device 'cuda' can't be used here ({NO_DRIVER}); choose one of cpu"),
        ("gpu", "device must be one of cpu on this machine, got 'gpu'"),
        ("cuda:7", "device must be one of cpu on this machine, got 'cuda:7'"),
    ],
)
def test_a_device_that_is_not_there_is_refused(name, expected, tmp_path, capsys):
    with pytest.raises(ValueError) as error:
        wive.Scene(*TRIANGLE, device=name)
    assert message(error) == expected
    np.savez(tmp_path / "mesh.npz", vertices=TRIANGLE[0], faces=TRIANGLE[1])
    for command in (["info"], ["render", "-o", str(tmp_path / "x.png")]):
        assert main([*command, str(tmp_path / "mesh.npz"), "--device", name]) == 2
        assert capsys.readouterr().err == f"wive: error: {expected}\n"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (
            lambda patch: patch.setitem(sys.modules, "warp", None),
            'NVIDIA Warp is not installed: pip install "wive[warp]"',
        ),
        (
            lambda patch: patch.setattr(devices.importlib.metadata, "version", lambda name: "1.4.1"),
            'NVIDIA Warp 1.4.1 is older than 1.19: pip install --upgrade "wive[warp]"',
        ),
    ],
)
@pytest.mark.parametrize("options", [{"backend": "warp"}, {"device": "cpu"}, {"device": "cuda:0"}])
def test_without_a_suitable_warp_the_error_says_how_to_get_it(monkeypatch, change, reason, options):
    monkeypatch.setattr(wive._cpu, "kernels", lambda: {"scalar": ""})
    change(monkeypatch)
    with pytest.raises(ValueError) as error:
        wive.Scene(*TRIANGLE, **options)
    assert message(error) == f"backend 'warp' can't run here ({reason}); choose one of auto, scalar"
    assert wive.backends()["warp"].devices == {}


# Python first looks for modules in the working folder; the repository's source folder has no core.
ELSEWHERE = tempfile.gettempdir()


def run_python(code: str) -> str:
    finished = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, cwd=ELSEWHERE
    )
    # The kernels of a machine that runs them for the first time are compiled.
    assert [line for line in finished.stderr.splitlines() if not line.startswith("wive: compiling ")] == []
    assert finished.returncode == 0
    return finished.stdout


def test_cpu_backends_never_import_warp():
    imports = "[name for name in ('warp', 'torch') if name in sys.modules]"
    program = f"""
import sys, wive
from wive import cli
wive.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).intersect([0, 0, 1], [0, 0, -1])
wive.backends()
print({imports})"""
    assert run_python(program) == "[]\n"


def test_warp_starts_silently():
    program = """
import wive
scene = wive.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], device="cpu")
print(scene.intersect([0.25, 0.25, 1], [0, 0, -1]).t)"""
    assert run_python(program) == "[1.]\n"


def test_info_names_the_device(tmp_path, capsys, device):
    vertices, faces = sphere(1)
    np.savez(tmp_path / "ball.npz", vertices=vertices, faces=faces)
    assert main(["info", str(tmp_path / "ball.npz"), "--device", device]) == 0
    assert f"backend    warp on {device}\n" in capsys.readouterr().out


def test_the_test_run_itself_refuses_a_device_that_is_not_there():
    command = [sys.executable, "-m", "pytest", "--device", "cuda:99", "--collect-only", "-q", __file__]
    finished = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=ELSEWHERE)
    assert finished.returncode == pytest.ExitCode.USAGE_ERROR
    assert "--device: device must be one of " in finished.stderr
