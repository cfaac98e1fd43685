"""What notebooks show of a scene, and the progress of long calls."""

import base64
import io
import re
import subprocess
import sys
import types

import numpy as np
import pytest
from support.meshes import sphere
from support.rooms import room

import wive
from wive._internal import cpu_tracer, progress
from wive._internal.progress import progress_of


def picture_of(html: str) -> np.ndarray:
    pillow = pytest.importorskip("PIL.Image")
    (content,) = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    with pillow.open(io.BytesIO(base64.b64decode(content))) as image:
        return np.asarray(image.convert("L"))


@pytest.mark.parametrize("mesh", [sphere(4), room()], ids=["object", "room"])
def test_a_scene_shows_itself_and_its_numbers(backend, mesh):
    html = wive.Scene(*mesh, backend=backend)._repr_html_()
    for text in (f"{len(mesh[1]):,}", f"{len(mesh[0]):,}", "watertight", "float32", backend):
        assert text in html
    picture = picture_of(html)
    assert picture.shape == (160, 240)
    assert len(np.unique(picture)) > 20
    assert len(html) < 200_000


def test_pictures_in_notebooks_do_not_depend_on_the_backend(usable_backends):
    pytest.importorskip("PIL")
    pictures = [picture_of(wive.Scene(*room(), backend=name)._repr_html_()) for name in usable_backends]
    for picture in pictures[1:]:
        np.testing.assert_array_equal(picture, pictures[0])


def test_several_meshes_and_float64_scenes_show_so():
    vertices, faces = sphere(2)
    scene = wive.Scene.from_meshes([(vertices.astype(np.float64) + 1e6, faces)] * 3)
    html = scene._repr_html_()
    assert "<th" in html and "meshes" in html and ">3<" in html and "float64" in html
    assert len(np.unique(picture_of(html))) > 20


@pytest.mark.parametrize("reason", ["empty", "no Pillow", "broken tracer", "broken numbers"])
def test_showing_a_scene_never_raises(monkeypatch, reason):
    scene = wive.Scene([], []) if reason == "empty" else wive.Scene(*sphere(1))
    if reason == "no Pillow":
        for name in ["PIL", *(name for name in sys.modules if name.startswith("PIL."))]:
            monkeypatch.setitem(sys.modules, name, None)
    if reason == "broken tracer":
        monkeypatch.setattr(cpu_tracer.CpuTracer, "at_once", None)
    if reason == "broken numbers":
        monkeypatch.setattr(wive.Scene, "memory", property(lambda scene: 1 / 0))
    html = scene._repr_html_()
    assert "<img" not in html
    assert str(len(scene)) in html


def test_a_scene_shows_the_shape_that_it_has_now():
    vertices, faces = sphere(3)
    scene = wive.Scene(vertices, faces)
    before = scene._repr_html_()
    scene.refit(vertices * np.float32([1, 1, 0.1]))
    assert scene._repr_html_() != before


def test_importing_wive_renders_nothing_and_imports_no_picture_library(tmp_path):
    libraries = "PIL", "tqdm", "IPython", "matplotlib", "OpenEXR", "tifffile"
    program = f"import sys, wive; print(sorted(set({libraries}) & set(sys.modules)))"
    command = [sys.executable, "-c", program]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60)
    assert ran.stdout == "[]\n"


def test_the_bar_is_the_notebooks_own_in_a_notebook(monkeypatch):
    """tqdm.auto chooses it."""
    seen = []

    class Bar:
        n = 0

        def __init__(self, **options):
            seen.append(options)

        def __enter__(self):
            return self

        def __exit__(self, *error):
            seen.append("closed")

        def update(self, units):
            self.n += units
            seen.append(units)

    tqdm, auto = types.ModuleType("tqdm"), types.ModuleType("tqdm.auto")
    auto.tqdm = Bar
    monkeypatch.setitem(sys.modules, "tqdm", tqdm)
    monkeypatch.setitem(sys.modules, "tqdm.auto", auto)
    monkeypatch.setattr(progress, "PERIOD", 0)
    with progress_of(True, 10, "row", "rendering") as asked:
        asked.at(0.4)
    assert seen[0]["total"] == 10 and seen[1:] == [4, 6, "closed"]


@pytest.mark.parametrize("shading", ["path", "ao", "headlight", "normals", "depth"])
def test_every_shading_has_a_bar_that_ends_full(capfd, shading):
    pytest.importorskip("tqdm")
    scene = wive.Scene(*sphere(2))
    wive.render(scene, shading=shading, width=16, height=12, spp=3, progress=True)
    error = capfd.readouterr().err
    assert "rendering: 100%" in error and " 12/12 " in error
    wive.render(scene, shading=shading, width=16, height=12, spp=3)
    assert capfd.readouterr().err == ""
