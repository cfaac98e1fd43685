"""Arrays of other libraries in host memory: read if they can be, else refused in one line with the reason."""

import enum
import sys
import types

import numpy as np
import pytest
from support.foreign_arrays import Foreign
from support.meshes import assert_same_hits, random_rays, sphere

import wive

RAYS = random_rays(20, seed=1)


class Exporting:
    """An array that NumPy can read through DLPack alone; its package makes none of what it reads."""

    def __init__(self, values):
        self.values = np.array(values)

    def __dlpack__(self, **options):
        return self.values.__dlpack__(**options)

    def __dlpack_device__(self):
        return (1, 0)


class Named(Exporting):
    """One whose device type is a member of an enum that is no integer, as Open3D's."""

    def __dlpack_device__(self):
        return Device.CPU, 0


class Device(enum.Enum):
    """The only member of Open3D's that matters here."""

    CPU = 1


class ReadOnly(Exporting):
    """One whose memory must not be written, as JAX's."""

    def __init__(self, values):
        super().__init__(values)
        self.values.flags.writeable = False


class Arrayish:
    """An array that has only `__array__`, as DataFrames."""

    def __init__(self, values):
        self.values = np.array(values)

    def __array__(self, dtype=None, copy=None):
        return self.values if dtype is None else self.values.astype(dtype)


class Broken(Foreign.Array):
    """An array whose library fails to export it with this error."""

    def __init__(self, error: Exception, at: str = "__dlpack__"):
        super().__init__(np.zeros((3, 3), np.float32))
        self.error, self.at = error, at

    def __dlpack__(self, **options):
        raise self.error

    def __dlpack_device__(self):
        if self.at == "__dlpack_device__":
            raise self.error
        return (1, 0)


KINDS = {
    "DLPack and back": Foreign.Array,
    "DLPack, one way": Exporting,
    "device type by name": Named,
    "__array__": Arrayish,
}
if np.lib.NumpyVersion(np.__version__) >= "2.1.0":  # before, NumPy itself doesn't export such arrays
    KINDS["read-only"] = ReadOnly


@pytest.fixture(params=KINDS)
def kind(request):
    return KINDS[request.param]


def values_of(array) -> np.ndarray:
    return array.values if isinstance(array, Foreign.Array) else np.asarray(array)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_meshes_and_rays_of_any_library_give_the_same_hits(kind, dtype):
    vertices, faces = sphere(1)
    vertices = vertices.astype(dtype)
    origins, directions = (rays.astype(dtype) for rays in RAYS)
    expected = wive.Scene(vertices, faces).intersect(origins, directions, 0.0, np.full(20, 9, dtype))
    scene = wive.Scene(kind(vertices), kind(faces))
    found = scene.intersect(kind(origins), kind(directions), 0.0, kind(np.full(20, 9, dtype)))
    for name in ("t", "prim", "uv"):
        np.testing.assert_allclose(values_of(getattr(found, name)), getattr(expected, name), rtol=1e-5)
    np.testing.assert_array_equal(
        values_of(scene.occluded(kind(origins), kind(directions))),
        wive.Scene(vertices, faces).occluded(*RAYS),
    )
    scene.refit(kind(2 * vertices))
    assert scene.bounds[1, 0] == pytest.approx(2 * vertices[:, 0].max())


def test_all_hits_of_a_library_that_makes_no_arrays_are_numpys():
    scene = wive.Scene(*sphere(1))
    found = scene.intersect_all(*map(Exporting, RAYS))
    expected = scene.intersect_all(*RAYS)
    for name in ("offsets", "t", "prim", "uv"):
        assert type(getattr(found, name)) is np.ndarray
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    np.testing.assert_array_equal(found.points(), expected.points())


def test_an_array_of_a_package_that_is_not_loaded_is_read(monkeypatch):
    """The type's module may have another name than the package that was imported."""
    elsewhere = types.new_class("Hidden", (Exporting,))
    elsewhere.__module__ = "_no_such_package.arrays"
    assert "_no_such_package" not in sys.modules
    scene = wive.Scene(*sphere(1))
    assert_same_hits(scene.intersect(*map(elsewhere, RAYS)), scene.intersect(*RAYS))


@pytest.mark.parametrize(
    "error",
    [
        BufferError("float8 has no DLPack type"),
        RuntimeError("Unsupported dtype\nin DLTensor."),
        TypeError("object of type 'NoneType' has no len()"),
        AttributeError("a traced array has no memory"),
        KeyError("x"),
        ValueError(),
    ],
)
@pytest.mark.parametrize("at", ["__dlpack__", "__dlpack_device__"])
def test_an_array_that_its_library_can_not_export_is_a_type_error(error, at):
    scene = wive.Scene(*sphere(1))
    good = Foreign.Array(np.zeros((3, 3), np.float32))
    broken = Broken(error, at)
    for name, call in (
        ("origins", lambda: scene.intersect(broken, good)),
        ("directions", lambda: scene.count(good, broken)),
        ("tmin", lambda: scene.occluded(good, good, broken)),
        ("tmax", lambda: scene.intersect_all(good, good, 0.0, broken)),
        ("vertices", lambda: wive.Scene(broken, [[0, 1, 2]])),
        ("faces", lambda: wive.Scene(sphere(0)[0], broken)),
        ("vertices", lambda: scene.refit(broken)),
    ):
        with pytest.raises(TypeError) as refused:
            call()
        text = str(refused.value)
        assert text.startswith(f"{name} must be an array that NumPy can read, got Broken (")
        assert text.endswith("): convert it first")
        assert "\n" not in text


class Untold:
    """An object whose `__array__` fails, as that of an array that a compiler traces."""

    def __array__(self, dtype=None, copy=None):
        raise TypeError("traced")


def test_an_object_that_is_no_array_after_all_is_a_type_error():
    for name, call in (
        ("vertices", lambda: wive.Scene(Untold(), [[0, 1, 2]])),
        ("eye", lambda: wive.Camera(Untold(), (0, 0, 0))),
        ("bounds", lambda: wive.Camera.framing(Untold())),
    ):
        with pytest.raises(
            TypeError, match=rf"^{name} must be an array that NumPy can read, got Untold \(traced"
        ):
            call()


def test_jax():
    jax = pytest.importorskip("jax")
    numpy = jax.numpy
    vertices, faces = sphere(1)
    scene = wive.Scene(numpy.asarray(vertices), numpy.asarray(faces))
    found = scene.intersect(*map(numpy.asarray, RAYS))
    assert isinstance(found.t, jax.Array)
    np.testing.assert_array_equal(np.asarray(found.prim), wive.Scene(vertices, faces).intersect(*RAYS).prim)
    with pytest.raises(TypeError, match=r"^origins must be an array that NumPy can read, got ArrayImpl"):
        scene.intersect(numpy.zeros((3, 3), numpy.bfloat16), numpy.zeros((3, 3)))
    with pytest.raises(TypeError, match=r"^origins must be an array that NumPy can read"):
        jax.jit(lambda rays: scene.intersect(rays, rays).t)(numpy.ones((3, 3)))


def torch_that_learns(values):
    return pytest.importorskip("torch").tensor(values, requires_grad=True)


@pytest.mark.parametrize("make", [Foreign.Array, Exporting, torch_that_learns])
def test_every_entry_point_reads_arrays_of_other_libraries(make):
    """Cameras, lights, embreex's scenes and trimesh's rays, as scenes do; also tensors with gradients."""
    scene, eye, middle = wive.Scene(*sphere(2)), np.array([0.5, 1, 4]), np.zeros(3)
    pose, lens, angles = np.eye(4), np.array([9.0, 9, 4, 4]), np.array([-10.0, 0, 10])
    for of in (
        lambda given: wive.Camera(given(eye), given(middle)).rays(4, 3),
        lambda given: wive.PinholeCamera(given(lens), given(pose)).rays(4, 3),
        lambda given: wive.OrthographicCamera(given(eye), given(middle)).rays(4, 3),
        lambda given: wive.EquirectangularCamera(given(eye), given(middle)).rays(4, 3),
        lambda given: wive.SpinningLidar(given(angles), given(angles), given(pose)).rays(),
        lambda given: [wive.render(scene, shading="path", sun=given(eye), width=8, height=4, spp=1)],
    ):
        for found, expected in zip(of(make), of(np.asarray), strict=True):
            np.testing.assert_array_equal(found, expected)
    origins, directions = (rows.astype(np.float64) for rows in RAYS)
    theirs = wive.embreex.EmbreeScene()
    wive.embreex.TriangleMesh(theirs, make(scene.vertices.astype(np.float64)), scene.faces)
    run = theirs.run(make(origins), make(directions), dists=make(np.full(len(origins), 9.0)))
    np.testing.assert_array_equal(run, theirs.run(origins, directions, dists=9.0))
    trimesh = pytest.importorskip("trimesh")
    ray = wive.trimesh.RayMeshIntersector(trimesh.creation.icosphere())
    found = ray.intersects_first(make(origins), make(directions))
    np.testing.assert_array_equal(found, ray.intersects_first(origins, directions))
    np.testing.assert_array_equal(ray.contains_points(make(origins)), ray.contains_points(origins))
