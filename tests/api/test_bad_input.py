"""Bad input ends in one line: the argument, the value expected, the value passed."""

import pickle
import sys

import numpy as np
import pytest
from support.meshes import TRIANGLE, sphere

import wive

VERTICES, FACES = TRIANGLE
ORIGINS = np.zeros((4, 3), np.float32)
NAN, INF = np.nan, np.inf


def broken(vertices: np.ndarray, index: int, value: float) -> np.ndarray:
    vertices = vertices.copy()
    vertices[index, 1] = value
    return vertices


def message(error: pytest.ExceptionInfo[Exception]) -> str:
    text = str(error.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("vertices", "faces", "kind", "expected"),
    [
        (VERTICES[:, :2], FACES, ValueError, "vertices must have shape (v, 3), got (3, 2)"),
        (VERTICES[0], FACES, ValueError, "vertices must have shape (v, 3), got (3,)"),
        (
            VERTICES.astype(complex),
            FACES,
            TypeError,
            "vertices must be a (v, 3) array of real numbers, got dtype complex128: convert it first",
        ),
        (
            [["a", "b", "c"]],
            FACES,
            TypeError,
            "vertices must be a (v, 3) array of real numbers, got dtype <U1: convert it first",
        ),
        (
            [[0, 0, 0], [1, 0]],
            FACES,
            ValueError,
            "vertices must be a (v, 3) array of real numbers, got rows of unequal length",
        ),
        (
            None,
            FACES,
            TypeError,
            "vertices must be a (v, 3) array of real numbers, got NoneType: convert it first",
        ),
        (
            VERTICES,
            FACES.astype(float),
            TypeError,
            "faces must be an (f, 3) array of integers, got dtype float64: round them to integer indices",
        ),
        (
            VERTICES,
            [[0, 1, 2, 0]],
            ValueError,
            "faces must have shape (f, 3), one row of three vertex indices per triangle, got (1, 4)",
        ),
        (
            VERTICES,
            [[0, 1, 2], [0, 1, 3]],
            ValueError,
            "faces must index the 3 vertices from 0, got [0, 1, 3] in face 1",
        ),
        (
            VERTICES,
            [[0, -1, 2]],
            ValueError,
            "faces must index the 3 vertices from 0, got [0, -1, 2] in face 0",
        ),
        (
            VERTICES,
            np.array([[0, 1, 2**32]]),
            ValueError,
            "faces must index the 3 vertices from 0, got [0, 1, 4294967296] in face 0",
        ),
        ([], FACES, ValueError, "faces must index the 0 vertices from 0, got [0, 1, 2] in face 0"),
    ],
)
def test_bad_meshes(vertices, faces, kind, expected):
    with pytest.raises(kind) as error:
        wive.Scene(vertices, faces)
    assert message(error) == expected


@pytest.mark.parametrize(
    ("value", "dtype"), [(NAN, np.float32), (INF, np.float32), (-INF, np.float64), (1e300, np.float64)]
)
def test_a_vertex_that_is_no_place_is_named_by_its_index(value, dtype):
    vertices, faces = sphere(1)
    vertices = broken(broken(vertices.astype(dtype), 17, value), 30, NAN)
    with pytest.raises(ValueError, match="17") as error:
        wive.Scene(vertices, faces)
    assert "vert" in message(error)


@pytest.mark.parametrize(
    ("options", "kind", "expected"),
    [
        (
            {"backend": "cuda"},
            ValueError,
            "backend must be one of auto, avx512, avx2, scalar, warp in this version of wive, got 'cuda': "
            "device 'cuda:0' is the first GPU",
        ),
        (
            {"backend": "cpu"},
            ValueError,
            "backend must be one of auto, avx512, avx2, scalar, warp in this version of wive, got 'cpu': "
            "'auto' is the fastest on the CPU",
        ),
        (
            {"backend": 3},
            ValueError,
            "backend must be one of auto, avx512, avx2, scalar, warp in this version of wive, got 3",
        ),
        (
            {"accuracy": "precise"},
            ValueError,
            "accuracy must be one of fast, watertight, exact in this version of wive, got 'precise'",
        ),
        (
            {"nodes": "small"},
            ValueError,
            "nodes must be one of float32, compressed in this version of wive, got 'small'",
        ),
        (
            {"device": "cuda:0", "backend": "scalar"},
            ValueError,
            "device is only for backend 'warp', got device 'cuda:0' with backend 'scalar': "
            "leave one of them out",
        ),
        (
            {"device": 0},
            TypeError,
            "device must be a name such as 'cpu' or 'cuda:0', got 0",
        ),
    ],
)
def test_bad_options(options, kind, expected):
    with pytest.raises(kind) as error:
        wive.Scene(VERTICES, FACES, **options)
    assert message(error) == expected


@pytest.fixture
def no_warp(monkeypatch):
    monkeypatch.setitem(sys.modules, "warp", None)


@pytest.mark.usefixtures("no_warp")
def test_an_unusable_backend_gives_its_reason_and_the_usable_ones(monkeypatch):
    monkeypatch.setattr(
        wive._cpu, "kernels", lambda: {"avx512": "this CPU lacks AVX-512", "avx2": "", "scalar": ""}
    )
    with pytest.raises(ValueError) as error:
        wive.Scene(VERTICES, FACES, backend="avx512")
    assert (
        message(error)
        == "backend 'avx512' can't run here (this CPU lacks AVX-512); choose one of auto, avx2, scalar"
    )
    assert wive.Scene(VERTICES, FACES).backend == "avx2"
    monkeypatch.setattr(wive._cpu, "kernels", lambda: {"scalar": ""})
    with pytest.raises(ValueError, match="not compiled into this build"):
        wive.Scene(VERTICES, FACES, backend="avx2")


@pytest.mark.usefixtures("no_warp")
def test_a_scene_saved_elsewhere_needs_its_backend_here_unless_it_was_auto(monkeypatch, tmp_path):
    wive.Scene(VERTICES, FACES).save(tmp_path / "auto")
    wive.Scene(VERTICES, FACES, backend="scalar").save(tmp_path / "scalar")
    pickled = pickle.dumps(wive.Scene(VERTICES, FACES))
    here = {"avx512": "", "avx2": "no such instructions", "scalar": "no such machine"}
    monkeypatch.setattr(wive._cpu, "kernels", lambda: here)
    assert wive.load(tmp_path / "auto").backend == "avx512"
    assert pickle.loads(pickled).backend == "avx512"
    with pytest.raises(ValueError) as error:
        wive.load(tmp_path / "scalar")
    assert message(error) == (
        f"{tmp_path / 'scalar'}: backend 'scalar' can't run here (no such machine); "
        "choose one of auto, avx512"
    )


@pytest.mark.parametrize("query", ["intersect", "occluded"])
@pytest.mark.parametrize(
    ("rays", "options", "kind", "expected"),
    [
        (
            (ORIGINS[:, :2], ORIGINS),
            {},
            ValueError,
            "origins must have shape (n, 3), or (3,) if all rays share it, got (4, 2)",
        ),
        (
            (ORIGINS, ORIGINS[None]),
            {},
            ValueError,
            "origins and directions must have one shape, or one of them (3,) if all rays share it, "
            "got (4, 3) and (1, 4, 3)",
        ),
        (
            (ORIGINS, ORIGINS[0, 0]),
            {},
            ValueError,
            "directions must have shape (n, 3), or (3,) if all rays share it, got ()",
        ),
        ((ORIGINS, ORIGINS[:3]), {}, ValueError, "origins and directions must be equally many, got 4 and 3"),
        (
            (ORIGINS.astype(bool), ORIGINS),
            {},
            TypeError,
            "origins must be an (n, 3) array of real numbers, got dtype bool: convert it first",
        ),
        (
            (ORIGINS, ORIGINS, [0, 0]),
            {},
            ValueError,
            "tmin must be one number or have shape (4,), one per ray, got shape (2,)",
        ),
        (
            (ORIGINS, ORIGINS, 0, ORIGINS),
            {},
            ValueError,
            "tmax must be one number or have shape (4,), one per ray, got shape (4, 3)",
        ),
        (
            (ORIGINS, ORIGINS, 0, None),
            {},
            TypeError,
            "tmax must be a real number or one per ray, got NoneType: convert it first",
        ),
        ((ORIGINS, ORIGINS), {"threads": 0}, ValueError, "threads must be from 1 to 2147483647, got 0"),
        ((ORIGINS, ORIGINS), {"threads": 1.5}, TypeError, "threads must be an integer, got float 1.5"),
        ((ORIGINS, ORIGINS), {"in_flight": -1}, ValueError, "in_flight must be from 1 to 2147483647, got -1"),
        ((ORIGINS, ORIGINS), {"lanes": 4}, ValueError, "lanes must be one of auto, 8, 1, got 4"),
    ],
)
def test_bad_rays(query, rays, options, kind, expected):
    with pytest.raises(kind) as error:
        getattr(wive.Scene(VERTICES, FACES), query)(*rays, **options)
    assert message(error) == expected


def test_numbers_beyond_float32_become_infinite_without_a_warning():
    scene = wive.Scene(*sphere(0))
    assert scene.occluded([0, 0, 0], [0.1, 0.2, 1], 0.0, 1e300).all()
    assert not scene.occluded([1e300, 0, 0], [1, 0, 0]).any()


@pytest.mark.parametrize(
    "call",
    [
        lambda value: wive.write_picture(value, np.zeros((2, 2, 3), np.float32)),
        lambda value: wive.Scene(VERTICES, FACES, device=value),
        lambda value: wive.Scene(VERTICES, FACES, backend=value),
        lambda value: wive.Scene(VERTICES, FACES, dtype=value),
        lambda value: wive.Scene(VERTICES, FACES).save(value),
        lambda value: wive.load(value),
        lambda value: wive.load_mesh(b"v 0 0 0", file_type=value),
        lambda value: wive.render(wive.Scene(VERTICES, FACES), shading=value),
        lambda value: wive.render(wive.Scene(VERTICES, FACES), value),
        lambda value: wive.estimate(value),
        lambda value: wive.set_threads(value),
        lambda value: wive.Camera((0, 0, 5), fov=value),
        lambda value: wive.stream(value, "rays.npy"),
        lambda value: wive.Scene.from_file(value),
    ],
)
def test_an_array_in_place_of_another_argument_is_named_in_one_line(call):
    """Arrays are printed on several lines."""
    with pytest.raises((TypeError, ValueError)) as error:
        call(np.zeros((3, 4, 5)))
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300
