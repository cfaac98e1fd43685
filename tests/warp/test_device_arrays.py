"""Results are arrays of the rays' library, and share memory with it, on every backend."""

import numpy as np
import pytest
from support.foreign_arrays import Foreign
from support.meshes import assert_same_hits, random_rays, soup

import wive

wp = pytest.importorskip("warp")

MESH = soup(300, seed=1)
RAYS = random_rays(777, seed=2, low=-0.5, high=1.5)


class Library:
    """Makes, reads and recognises a library's arrays."""

    def __init__(self, name, device):
        self.name, self.device = name, device
        if name in ("torch", "jax"):
            self.module = pytest.importorskip(name)

    def make(self, values):
        if self.name == "warp.vec3":
            return wp.array(values, dtype=wp.vec3 if np.ndim(values) == 2 else float, device=self.device)
        if self.name == "warp":
            return wp.array(values, dtype=float, device=self.device)
        if self.name == "torch":
            return self.module.tensor(values, device=self.device)
        if self.name == "jax":
            return self.module.device_put(values, self.module.devices(self.device.partition(":")[0])[0])
        return Foreign.Array(values)

    def read(self, array):
        if self.name.startswith("warp"):
            assert type(array) is wp.array
            assert array.device.alias == self.device
            return array.numpy()
        if self.name == "torch":
            assert isinstance(array, self.module.Tensor)
            assert str(array.device) == self.device
            return array.cpu().numpy()
        if self.name == "jax":
            assert isinstance(array, self.module.Array)
            return np.asarray(array)
        assert isinstance(array, Foreign.Array)
        return array.values


@pytest.fixture(params=["warp", "warp.vec3", "torch", "jax", "dlpack"])
def library(request, backend, device):
    place = device if backend == "warp" else "cpu"
    if request.param == "dlpack" and place != "cpu":
        pytest.skip("the tests' own library has host memory only")
    return Library(request.param, place)


@pytest.fixture
def scene(backend):
    return wive.Scene(*MESH, backend=backend)


def test_hits_come_back_in_the_library_of_the_rays(scene, library):
    expected, counted = scene.intersect(*RAYS, stats=True)
    hits, stats = scene.intersect(*map(library.make, RAYS), stats=True)
    assert len(hits) == 777
    assert "777 rays" in repr(hits)
    for name in ("t", "prim", "uv", "mask"):
        found, wanted = library.read(getattr(hits, name)), getattr(expected, name)
        assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape)
        np.testing.assert_array_equal(found, wanted)
    # JAX has no float64 without jax_enable_x64.
    rounding = 1e-6 if library.name == "jax" else 1e-14
    np.testing.assert_allclose(library.read(hits.points()), expected.points(), rtol=rounding)
    np.testing.assert_allclose(library.read(hits.normals()), expected.normals(), rtol=rounding)
    for found, wanted in zip(stats, counted, strict=True):
        np.testing.assert_array_equal(library.read(found), wanted)


def test_spawned_origins_and_error_bounds_come_back_in_the_library_of_the_rays(scene, library):
    expected = scene.intersect(*RAYS)
    hits = scene.intersect(*map(library.make, RAYS))
    bounds, wanted = library.read(hits.error_bound), expected.error_bound
    np.testing.assert_allclose(bounds, wanted, rtol=1e-6 if library.name == "jax" else 0)
    up = np.array([0, 0, 1], np.float32)
    for directions in (RAYS[1], up):
        origins, wanted = hits.spawn(library.make(directions)), expected.spawn(directions)
        np.testing.assert_array_equal(library.read(origins), wanted)
        np.testing.assert_array_equal(library.read(hits.spawn(directions)), wanted)
        if library.name != "dlpack":  # whose arrays from elsewhere are read-only in these tests
            blocked = scene.occluded(origins, library.make(RAYS[1]))
            np.testing.assert_array_equal(library.read(blocked), scene.occluded(wanted, RAYS[1]))
    with pytest.raises(
        ValueError, match=r"directions must have shape \(777, 3\), one per hit, or \(3,\), got"
    ):
        hits.spawn(library.make(RAYS[1][:5]))


def test_occluded_comes_back_in_the_library_of_the_rays(scene, library):
    rays = [library.make(array) for array in RAYS]
    blocked = library.read(scene.occluded(*rays, 0.25, 0.75))
    assert blocked.dtype == np.bool_
    np.testing.assert_array_equal(blocked, scene.occluded(*RAYS, 0.25, 0.75))


def test_all_hits_come_back_in_the_library_of_the_rays(scene, library):
    expected, counted = scene.intersect_all(*RAYS, stats=True)
    hits, stats = scene.intersect_all(*map(library.make, RAYS), stats=True)
    assert len(hits) == 777
    assert "777 rays" in repr(hits) and f"{len(expected.t)} hits" in repr(hits)
    # JAX has neither int64 nor float64 without jax_enable_x64.
    exact = library.name != "jax"
    for name in ("offsets", "t", "prim", "uv", "counts", "ray"):
        found, wanted = library.read(getattr(hits, name)), getattr(expected, name)
        assert found.shape == wanted.shape
        assert found.dtype == wanted.dtype or (wanted.dtype == np.int64 and not exact)
        np.testing.assert_array_equal(found, wanted)
    for name in ("points", "normals"):
        found, wanted = library.read(getattr(hits, name)()), getattr(expected, name)()
        np.testing.assert_allclose(found, wanted, rtol=1e-14 if exact else 1e-6)
    for found, wanted in zip(stats, counted, strict=True):
        np.testing.assert_array_equal(library.read(found), wanted)


def test_counts_come_back_in_the_library_of_the_rays(scene, library):
    counts = library.read(scene.count(*map(library.make, RAYS), 0.25, 0.75))
    assert counts.dtype == np.int32
    np.testing.assert_array_equal(counts, scene.count(*RAYS, 0.25, 0.75))


def test_hits_of_one_ray_are_in_the_library_of_the_rays(scene, library):
    expected = scene.intersect_all(*RAYS)
    hits = scene.intersect_all(*map(library.make, RAYS))
    most, none = int(expected.counts.argmax()), int(expected.counts.argmin())
    for i in (most, none, -1):
        mine = hits[i]
        assert len(mine) == 1
        np.testing.assert_array_equal(library.read(mine.t), expected[i].t)
        np.testing.assert_array_equal(library.read(mine.offsets), expected[i].offsets)
        assert library.read(mine.points()).shape == expected[i].points().shape
    with pytest.raises(IndexError, match="ray 777 of 777: count from 0 to 776"):
        hits[777]


def test_limits_may_be_numbers_or_arrays_of_the_library(scene, library):
    limits = np.random.default_rng(3).uniform(0, 0.7, (2, 777)).astype(np.float32)
    expected = scene.intersect(*RAYS, *limits)
    hits = scene.intersect(*map(library.make, RAYS), *map(library.make, limits))
    np.testing.assert_array_equal(library.read(hits.t), expected.t)
    mixed = scene.intersect(*map(library.make, RAYS), 0.25, library.make(limits[1]))
    np.testing.assert_array_equal(library.read(mixed.t), scene.intersect(*RAYS, 0.25, limits[1]).t)


def test_a_vector_shared_by_all_rays_may_be_of_the_library_or_a_list(scene, library):
    origins, directions = RAYS
    expected = scene.intersect(origins, directions[0])
    lists = scene.intersect(library.make(origins), directions[0].tolist())
    np.testing.assert_array_equal(library.read(lists.prim), expected.prim)
    if library.name != "warp.vec3":
        own = scene.intersect(library.make(origins), library.make(directions[0]))
        np.testing.assert_array_equal(library.read(own.prim), expected.prim)
        assert len(scene.intersect(library.make(origins[0]), library.make(directions[0]))) == 1


def test_no_rays_give_no_hits_in_any_library(scene, library):
    none = np.zeros((0, 3), np.float32)
    hits = scene.intersect(library.make(none), library.make(none))
    assert library.read(hits.uv).shape == (0, 2)
    assert library.read(hits.points()).shape == (0, 3)
    assert library.read(scene.occluded(library.make(none), library.make(none))).shape == (0,)
    assert library.read(scene.count(library.make(none), library.make(none))).shape == (0,)
    every = scene.intersect_all(library.make(none), library.make(none))
    np.testing.assert_array_equal(library.read(every.offsets), [0])
    assert library.read(every.uv).shape == (0, 2)


def test_strided_rays_are_not_copied(scene, library):
    if library.name in ("jax", "warp.vec3", "dlpack"):
        pytest.skip("no strided arrays of this library")
    rows = library.make(np.concatenate(RAYS, axis=1))
    hits = scene.intersect(rows[:, :3], rows[:, 3:])
    np.testing.assert_array_equal(library.read(hits.t), scene.intersect(*RAYS).t)


def test_rays_repeated_by_a_stride_of_zero_count_as_many(scene, backend, device):
    place = device if backend == "warp" else "cpu"
    one = wp.array(RAYS[0][:1], dtype=wp.vec3, device=place)
    many = wp.array(ptr=one.ptr, dtype=wp.vec3, shape=(5,), strides=(0,), device=place)
    hits = scene.intersect(many, many)
    assert hits.t.shape == (5,)
    np.testing.assert_array_equal(
        hits.prim.numpy(), scene.intersect(*[RAYS[0][:1].repeat(5, axis=0)] * 2).prim
    )


def test_a_mesh_may_be_arrays_of_any_library(library):
    if library.device != "cpu":
        pytest.skip("trees are built in host memory")
    scene = wive.Scene(library.make(MESH[0]), MESH[1])
    np.testing.assert_array_equal(scene.vertices, MESH[0])
    assert_same_hits(scene.intersect(*RAYS), wive.Scene(*MESH).intersect(*RAYS))


def test_warp_arrays_of_vectors_give_vectors_and_of_columns_columns(scene, backend, device):
    place = device if backend == "warp" else "cpu"
    vectors = [wp.array(rows, dtype=wp.vec3, device=place) for rows in RAYS]
    columns = [wp.array(rows, dtype=float, device=place) for rows in RAYS]
    assert scene.intersect(*vectors).uv.dtype is wp.vec2
    assert scene.intersect(*vectors).normals().dtype is wp.vec3d
    assert scene.intersect(*columns).uv.dtype is wp.float32
    assert scene.intersect(*columns).uv.shape == (777, 2)


def test_queries_neither_copy_rays_nor_touch_them(device):
    if device != "cpu":
        pytest.skip("looks at host memory")
    from wive.warp_kernels.scene.rays import RayLoader

    vectors = [wp.array(rows, dtype=wp.vec3, device="cpu") for rows in RAYS]
    for given in (RAYS, vectors):
        rays = wive._internal.rays.check_rays(*given, 0.0, np.inf, "warp", "cpu")
        loader = RayLoader("cpu")
        loaded = loader.from_numpy(rays) if given is RAYS else loader.from_device(rays)
        for array, origin in zip((loaded.origins, loaded.directions), given, strict=True):
            assert array.ptr == (origin.ctypes.data if given is RAYS else origin.ptr)


@pytest.mark.parametrize("query", ["intersect", "occluded", "count", "intersect_all"])
def test_the_library_of_each_array_is_looked_up_once(scene, backend, device, monkeypatch, query):
    from wive._internal import arrays
    from wive.warp_kernels.scene import rays as warp_rays

    looked_up = []

    def library_of(value):
        looked_up.append(value)
        return arrays.library_of(value)

    for module in (wive._internal.rays, warp_rays):
        monkeypatch.setattr(module, "library_of", library_of)
    place = device if backend == "warp" else "cpu"
    rays = [wp.array(rows, dtype=wp.vec3, device=place) for rows in RAYS]
    getattr(scene, query)(*rays, 0.0, 1.0)
    assert len(looked_up) == 4


def test_an_array_with_nothing_but_the_cuda_interface_has_a_length_for_warp(monkeypatch):
    class OnlyInterface:
        __cuda_array_interface__ = {"shape": (4, 3), "typestr": "<f4", "data": (256, False), "version": 2}  # noqa: RUF012

    given = []
    monkeypatch.setattr(wp, "array", lambda data, device, copy: given.append((data, device, copy)))
    array = OnlyInterface()
    wive._internal.arrays.CUDA_INTERFACE.to_warp(array, "cuda:0")
    ((data, device, copy),) = given
    assert (len(data), device, copy) == (4, "cuda:0", False)  # Warp refuses data without a length
    assert data.__cuda_array_interface__ == array.__cuda_array_interface__


def test_hits_on_a_device_keep_what_they_are_made_of(device):
    hits = wive.Scene(*MESH, device=device).intersect(
        *(wp.array(rows, dtype=wp.vec3, device=device) for rows in RAYS)
    )
    wanted = wive.Scene(*MESH, backend="scalar").intersect(*RAYS)
    np.testing.assert_array_equal(hits.points().numpy(), wanted.points())
    np.testing.assert_array_equal(hits.faces, MESH[1])


def test_a_launch_on_a_device_neither_allocates_limits_nor_reads_back(monkeypatch, device):
    scene = wive.Scene(*MESH, device=device)
    rays = [wp.array(rows, dtype=wp.vec3, device=device) for rows in RAYS]
    scene.intersect(*rays)

    def refused(*arguments, **keywords):
        raise AssertionError("not on the way of a launch that may be captured")

    for name in ("full", "array.numpy", "synchronize_device", "synchronize", "copy"):
        monkeypatch.setattr(f"warp.{name}", refused)
    hits = scene.intersect(*rays)
    monkeypatch.undo()
    assert_same_hits_in_warp(hits, scene.intersect(*RAYS))


def assert_same_hits_in_warp(found, expected):
    numpy_hits = wive.Hits(found.t.numpy(), found.prim.numpy(), found.uv.numpy(), *MESH)
    assert_same_hits(numpy_hits, expected)


def test_queries_work_inside_a_capture(device):
    if device == "cpu":
        pytest.skip("captures are CUDA's")
    scene = wive.Scene(*MESH, device=device)
    rays = [wp.array(rows, dtype=wp.vec3, device=device) for rows in RAYS]
    scene.intersect(*rays)
    with wp.ScopedCapture(device) as capture:
        hits = scene.intersect(*rays)
    for array in rays:
        array.assign(array.numpy()[::-1].copy())
    wp.capture_launch(capture.graph)
    assert_same_hits_in_warp(hits, scene.intersect(*(rows[::-1] for rows in RAYS)))
