"""An option that a scene's backend doesn't have is refused, by one rule for all of them."""

import inspect

import numpy as np
import pytest
from support.meshes import TRIANGLE

import wive
from wive._internal.options import SceneOptions
from wive.cli import main

RAYS = np.float32([[0.25, 0.25, 1]]), np.float32([[0, 0, -1]])
QUERIES = ("intersect", "occluded", "intersect_all", "count")
# Each option with a value, and which backends have it.
OPTIONS = {
    "threads": (2, "CPU backends"),
    "in_flight": (3, "CPU backends"),
    "lanes": (8, "backend 'warp'"),
}


def has(backend: str, option: str) -> bool:
    return (backend == "warp") == (option == "lanes")


def refusal(backend: str, option: str) -> str:
    value, owners = OPTIONS[option]
    return f"{option} is only for {owners}, got {value} with backend {backend!r}: leave it out"


@pytest.mark.parametrize("query", QUERIES)
@pytest.mark.parametrize("option", OPTIONS)
def test_queries_refuse_the_options_of_other_backends(backend, option, query):
    ask = getattr(wive.Scene(*TRIANGLE, backend=backend), query)
    if has(backend, option):
        assert ask(*RAYS, **{option: OPTIONS[option][0]}) is not None
        return
    with pytest.raises(ValueError) as error:
        ask(*RAYS, **{option: OPTIONS[option][0]})
    assert str(error.value) == refusal(backend, option)


@pytest.mark.parametrize("query", QUERIES)
def test_an_option_left_open_is_for_every_backend(backend, query):
    ask = getattr(wive.Scene(*TRIANGLE, backend=backend), query)
    assert ask(*RAYS, threads=None, in_flight=None, lanes="auto", stats=False) is not None


def test_pictures_refuse_threads_on_a_device(device):
    scene = wive.Scene(*TRIANGLE, device=device)
    with pytest.raises(ValueError) as error:
        wive.render(scene, width=2, height=2, spp=1, threads=2)
    assert str(error.value) == refusal("warp", "threads")


def test_the_command_line_refuses_threads_on_a_device(device, tmp_path, capsys):
    np.savez(tmp_path / "mesh.npz", vertices=TRIANGLE[0], faces=TRIANGLE[1])
    np.save(tmp_path / "rays.npy", np.concatenate(RAYS, axis=1))
    paths = [str(tmp_path / name) for name in ("mesh.npz", "rays.npy")]
    command = ["trace", *paths, "-o", str(tmp_path / "hits.npz"), "--device", device, "--threads", "2"]
    assert main(command) == 2
    assert capsys.readouterr().err == f"wive: error: {refusal('warp', 'threads')}\n"
    assert not (tmp_path / "hits.npz").exists()


def test_type_checkers_know_every_option_of_a_scene_in_its_other_constructors():
    parameters = inspect.signature(wive.Scene).parameters.values()
    options = {parameter.name for parameter in parameters if parameter.kind == parameter.KEYWORD_ONLY}
    assert set(SceneOptions.__annotations__) == options
