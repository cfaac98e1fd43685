"""Arrays that a scene can't take are refused in one line: the argument, expected, got, the remedy."""

import numpy as np
import pytest
from support.foreign_arrays import Foreign
from support.meshes import TRIANGLE

import wive

wp = pytest.importorskip("warp")

ROWS = np.zeros((4, 3), np.float32)
ON_CUDA = Foreign.Array(ROWS, place=(2, 0))
ON_VULKAN = Foreign.Array(ROWS, place=(7, 0))


class OnlyCudaInterface:
    __cuda_array_interface__: dict = {}  # noqa: RUF012


def vec3(rows=ROWS, **options):
    return wp.array(rows, dtype=wp.vec3, device="cpu", **options)


def plain(values, dtype=float):
    return wp.array(values, dtype=dtype, device="cpu")


@pytest.mark.parametrize("query", ["intersect", "occluded"])
@pytest.mark.parametrize(
    ("options", "rays", "kind", "expected"),
    [
        (
            {"backend": "scalar"},
            lambda: (ON_CUDA, ON_CUDA),
            ValueError,
            "origins must be in host memory for backend 'scalar', got an array on cuda:0: "
            "copy it to the host, or make the scene with device='cuda:0'",
        ),
        (
            {"backend": "scalar"},
            lambda: (OnlyCudaInterface(), OnlyCudaInterface()),
            ValueError,
            "origins must be in host memory for backend 'scalar', got an array on a CUDA device: "
            "copy it to the host, or make the scene with device='cuda:0'",
        ),
        (
            {"device": "cpu"},
            lambda: (ON_CUDA, ON_CUDA),
            ValueError,
            "origins must be on the scene's device cpu, got an array on cuda:0: "
            "copy it there, or make the scene on that device",
        ),
        (
            {"device": "cpu"},
            lambda: (OnlyCudaInterface(), OnlyCudaInterface()),
            ValueError,
            "origins must be on the scene's device cpu, got an array on a CUDA device: "
            "copy it there, or make the scene on that device",
        ),
        (
            {"device": "cpu"},
            lambda: (ON_VULKAN, ON_VULKAN),
            ValueError,
            "origins must be on the scene's device cpu, got an array on DLPack device 7: "
            "copy it there, or make the scene on that device",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), Foreign.Array(ROWS)),
            TypeError,
            "origins and directions must be arrays of one library, got Warp and foreign: convert one of them",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), ROWS),
            TypeError,
            "origins and directions must be arrays of one library, got Warp and NumPy: convert one of them",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), vec3(), np.zeros(4)),
            TypeError,
            "origins and tmin must be arrays of one library, got Warp and NumPy: convert one of them",
        ),
        (
            {"device": "cpu"},
            lambda: (plain(ROWS, wp.float64), vec3()),
            TypeError,
            "origins must be float32 on a Warp device, where nothing is converted, got float64: "
            "convert it first",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), Foreign.Array(ROWS.astype(complex))),
            TypeError,
            "origins and directions must be arrays of one library, got Warp and foreign: convert one of them",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), plain(ROWS[:, :2])),
            ValueError,
            "directions must have shape (n, 3), or (3,) if all rays share it, got (4, 2)",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), 5.0),
            ValueError,
            "directions must have shape (n, 3), or (3,) if all rays share it, got ()",
        ),
        (
            {"device": "cpu"},
            lambda: (wp.array(ROWS[None], dtype=wp.vec3, device="cpu"), vec3()),
            ValueError,
            "origins and directions must have one shape, or one of them (3,) if all rays share it, "
            "got (1, 4, 3) and (4, 3)",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), vec3(ROWS[:3])),
            ValueError,
            "origins and directions must be equally many, got 4 and 3",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), vec3(), plain(np.zeros(3))),
            ValueError,
            "tmin must be one number or have shape (4,), one per ray, got shape (3,)",
        ),
        (
            {"device": "cpu"},
            lambda: (vec3(), vec3(), 0.0, vec3()),
            ValueError,
            "tmax must be one number or have shape (4,), one per ray, got shape (4, 3)",
        ),
    ],
)
def test_arrays_that_a_scene_cannot_take(query, options, rays, kind, expected):
    with pytest.raises(kind) as error:
        getattr(wive.Scene(*TRIANGLE, **options), query)(*rays())
    assert str(error.value) == expected


def test_a_mesh_on_a_device_is_refused():
    for mesh, name in (((ON_CUDA, TRIANGLE[1]), "vertices"), ((TRIANGLE[0], ON_CUDA), "faces")):
        with pytest.raises(ValueError) as error:
            wive.Scene(*mesh)
        assert str(error.value) == (
            f"{name} must be in host memory, where trees are built, got an array on cuda:0: "
            "copy it to the host"
        )


def test_a_dtype_that_warp_has_no_name_for_is_refused_like_any():
    torch = pytest.importorskip("torch")
    rays = torch.zeros((4, 3), dtype=torch.complex64)
    with pytest.raises(TypeError) as error:
        wive.Scene(*TRIANGLE, device="cpu").intersect(rays, rays)
    assert str(error.value) == (
        "origins must be float32 on a Warp device, where nothing is converted, got torch.complex64: "
        "convert it first"
    )


def test_host_tensors_of_any_real_dtype_are_converted_on_cpu_backends():
    torch = pytest.importorskip("torch")
    scene = wive.Scene(*TRIANGLE, backend="scalar")
    origins = torch.tensor([[0.25, 0.5, 0.0]], dtype=torch.float64)
    hits = scene.intersect(origins, torch.tensor([[0, 0, 2]]))
    assert hits.t.tolist() == [0.5]
