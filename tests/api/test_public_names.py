"""What users see of the package: its names, its signatures, and what importing it brings."""

import copy
import inspect
import pickle
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from support.meshes import TRIANGLE, sphere

import wive


def functions() -> dict[str, object]:
    """Every public function, class and method, by dotted name."""
    found: dict[str, object] = {}
    for name in wive.__all__:
        member = getattr(wive, name)
        if inspect.ismodule(member):
            continue
        found[name] = member
    for module, names in {
        "trimesh": ("RayMeshIntersector", "install", "installed", "uninstall"),
        "embreex": ("EmbreeDevice", "EmbreeScene", "ElementMesh", "TriangleMesh"),
    }.items():
        found |= {f"{module}.{name}": getattr(getattr(wive, module), name) for name in names}
    for name, member in list(found.items()):
        if inspect.isclass(member):
            methods = inspect.getmembers(member, inspect.isroutine)
            found |= {f"{name}.{key}": method for key, method in methods if not key.startswith("_")}
    return found


def test_the_package_shows_its_public_names_alone():
    assert sorted(dir(wive)) == sorted(wive.__all__)
    assert all(hasattr(wive, name) for name in wive.__all__)


def run(program: str) -> str:
    """What a Python of its own prints."""
    finished = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=tempfile.gettempdir(),
        check=True,
    )
    return finished.stdout


PARTS = {"dask": "dask", "torch": "torch", "warp_kernels": "warp"}  # and the packages that they need


@pytest.mark.parametrize(("part", "package"), PARTS.items())
def test_parts_that_need_another_package_are_there_without_an_import(part, package):
    pytest.importorskip(package)
    assert run(f"import wive; print(wive.{part}.__name__)") == f"wive.{part}\n"


@pytest.mark.parametrize(("part", "package"), PARTS.items())
def test_parts_say_what_to_install(part, package):
    program = f"""
import sys, wive
sys.modules[{package!r}] = None
try:
    wive.{part}
except ImportError as error:
    print(error)"""
    assert re.match(rf"wive\.{part} needs .*: pip install ", run(program))


@pytest.mark.parametrize(("name", "function"), functions().items(), ids=functions())
def test_signatures_fit_on_a_screen(name, function):
    assert len(str(inspect.signature(function))) <= 5 * 80, name  # five lines of a terminal


def test_a_source_folder_without_a_compiled_core_is_named(tmp_path):
    source = Path(wive.__file__).parent
    (tmp_path / "wive").mkdir()
    (tmp_path / "wive" / "__init__.py").write_bytes((source / "__init__.py").read_bytes())
    program = f"""
import sys
sys.path.insert(0, {str(tmp_path)!r})
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in type(finder).__module__]
try:
    import wive
except ImportError as error:
    print(error)"""
    assert f"there is none in {tmp_path / 'wive'}): install with" in run(program)


def test_importing_the_package_imports_nothing_slow():
    slow = "argparse email importlib.metadata secrets tempfile trimesh tqdm warp torch PIL matplotlib"
    program = f"""
import sys, numpy
before = set(sys.modules)
import wive
print(sorted((set(sys.modules) - before) & set({slow.split()!r})))"""
    assert run(program) == "[]\n"


def test_scenes_of_cpu_backends_do_not_look_at_the_version_of_warp(monkeypatch):
    def refused(name: str) -> str:
        raise AssertionError(f"the version of {name} was looked up")

    monkeypatch.setattr("importlib.metadata.version", refused)
    assert wive.Scene(*TRIANGLE).device is None
    assert wive.Scene(*TRIANGLE, backend="scalar").backend == "scalar"


@pytest.mark.parametrize("query", ["intersect", "intersect_all"])
def test_hits_can_be_pickled_and_copied_and_equal_themselves_alone(query):
    scene = wive.Scene(*sphere(2))
    hits = getattr(scene, query)(np.zeros((5, 3), np.float32), np.eye(5, 3, dtype=np.float32))
    pickled = [pickle.loads(pickle.dumps(hits, protocol)) for protocol in range(pickle.HIGHEST_PROTOCOL + 1)]
    for again in (*pickled, copy.copy(hits), copy.deepcopy(hits)):
        assert type(again) is type(hits)
        assert repr(again) == repr(hits)
        assert again != hits
        for name in ("t", "prim", "uv", "vertices", "faces"):
            np.testing.assert_array_equal(getattr(again, name), getattr(hits, name))
        np.testing.assert_array_equal(again.points(), hits.points())
    if query == "intersect":
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(hits)).error_bound, hits.error_bound)
    assert hits == hits
    assert len({hits, hits}) == 1


@pytest.mark.parametrize("query", ["intersect", "intersect_all"])
def test_hits_are_read_only(query):
    hits = getattr(wive.Scene(*TRIANGLE), query)(np.zeros((1, 3)), np.ones((1, 3)))
    with pytest.raises(AttributeError, match="read-only"):
        hits.t = hits.t + 1
    with pytest.raises(AttributeError, match="read-only"):
        del hits.prim
