"""What memory can't hold is a MemoryError, at once, and the scene is as it was."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.meshes import TRIANGLE, random_rays, soup, sphere

import wive
from wive import _cpu

KIB = 1024
QUERIES = ("intersect", "occluded", "intersect_all", "count")
HIT_BYTES = {("cpu", "float32"): 24, ("cpu", "float64"): 40, ("warp", "float32"): 32, ("warp", "float64"): 60}


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def group(folder: Path, version: int, limit: int | str, used: int, cached: int = 0) -> None:
    """The files of a control group's memory."""
    names = (
        ("memory.max", "memory.current")
        if version == 2
        else ("memory.limit_in_bytes", "memory.usage_in_bytes")
    )
    write(folder / names[0], f"{limit}\n")
    write(folder / names[1], f"{used}\n")
    prefix = "" if version == 2 else "total_"
    write(folder / "memory.stat", f"anon 5\n{prefix}inactive_file {cached}\n{prefix}active_file 999\n")


@pytest.fixture
def machine(tmp_path) -> Path:
    """A folder with the files of a machine that has a million KiB available."""
    write(tmp_path / "proc/meminfo", "MemTotal: 9000000 kB\nMemFree: 5 kB\nMemAvailable:  1000000 kB\n")
    return tmp_path


def available(machine: Path) -> int:
    return _cpu.available_memory(str(machine))


def test_available_memory_is_the_systems(machine):
    assert available(machine) == 1_000_000 * KIB
    assert 0 < _cpu.available_memory() < 2**60


def test_a_system_that_does_not_tell_has_no_limit(tmp_path):
    assert available(tmp_path) > 2**62


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("path", ["/", "/a", "/a/b.slice/c"])
def test_a_control_group_limits_what_is_available(machine, version, path):
    mount = machine / "sys/fs/cgroup" / ("memory" if version == 1 else "")
    line = f"4:cpu,memory:{path}\n" if version == 1 else f"0::{path}\n"
    write(machine / "proc/self/cgroup", f"9:name=systemd:/x\n{line}2:cpuset:/y\n")
    group(mount / path[1:], version, limit=5000, used=4000, cached=300)
    assert available(machine) == 5000 - (4000 - 300)
    group(mount / path[1:], version, limit=5000, used=6000)
    assert available(machine) == 0
    group(mount / path[1:], version, limit="max" if version == 2 else 2**63 - 4096, used=6000)
    assert available(machine) == 1_000_000 * KIB


@pytest.mark.parametrize("version", [1, 2])
def test_groups_around_a_group_limit_it(machine, version):
    mount = machine / "sys/fs/cgroup" / ("memory" if version == 1 else "")
    write(machine / "proc/self/cgroup", "3:memory:/outer/inner\n" if version == 1 else "0::/outer/inner\n")
    group(mount / "outer/inner", version, limit=9000, used=1000)
    group(mount / "outer", version, limit=5000, used=3000)
    assert available(machine) == 2000


@pytest.mark.parametrize("version", [1, 2])
def test_a_container_that_sees_the_hosts_path_finds_its_own_limit(machine, version):
    mount = machine / "sys/fs/cgroup" / ("memory" if version == 1 else "")
    write(machine / "proc/self/cgroup", "3:memory:/docker/5f\n" if version == 1 else "0::/../docker/5f\n")
    group(mount, version, limit=7000, used=1000)
    assert available(machine) == 6000


def test_amounts_that_are_not_there_are_refused():
    _cpu.expect_memory(2**20)
    with pytest.raises(MemoryError, match=r"^not enough memory: 1024\.0 TiB needed, .*iB available$"):
        _cpu.expect_memory(2**50)


def repeated(row: list[float], count: int, dtype: type) -> np.ndarray:
    """`count` equal rows in the memory of one."""
    return np.broadcast_to(np.array([row], dtype), (count, 3))


@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint8])
@pytest.mark.parametrize("count", [2**31, 2**40])
def test_more_faces_than_a_tree_numbers_are_refused_at_once(count, dtype):
    with pytest.raises(ValueError) as error:
        wive.Scene(TRIANGLE[0], repeated([0, 1, 2], count, dtype))
    assert str(error.value) == (
        f"faces must be at most 2147483647 in one scene, got {count}: split the mesh into several"
    )


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int8])
def test_more_vertices_than_faces_can_name_are_refused_at_once(dtype):
    with pytest.raises(ValueError, match=r"^vertices must be at most 2147483647 in one scene, got 42949"):
        wive.Scene(repeated([0, 1, 2], 2**32, dtype), TRIANGLE[1])


def test_a_mesh_that_does_not_fit_is_refused_before_it_is_copied(monkeypatch):
    monkeypatch.setattr(_cpu, "expect_memory", lambda size: _refuse_above(2**30, size))
    for vertices, faces in (
        (repeated([0, 1, 2], 10**9, np.float32), TRIANGLE[1]),
        (repeated([0, 1, 2], 10**9, np.float64), TRIANGLE[1]),
        (TRIANGLE[0], repeated([0, 1, 2], 10**9, np.int32)),
        (TRIANGLE[0], repeated([0, 1, 2], 10**9, np.int64)),
    ):
        with pytest.raises(MemoryError):
            wive.Scene(vertices, faces)


def _refuse_above(available_bytes: int, size: int) -> None:
    if size > available_bytes:
        raise MemoryError("not enough memory")


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int16])
@pytest.mark.parametrize("query", QUERIES)
def test_ten_thousand_million_rays_are_refused_at_once(backend, query, dtype):
    scene = wive.Scene(*sphere(2), backend=backend)
    rays = random_rays(100, seed=1)
    before = getattr(scene, query)(*rays)
    many = repeated([0, 0, 1], 10**10, dtype)
    for origins, directions in ((many, many), ([0, 0, 1], many), (many, [0, 0, 1])):
        with pytest.raises(MemoryError):
            getattr(scene, query)(origins, directions)
    after = getattr(scene, query)(*rays)
    for name in ("t", "prim", "uv", "offsets"):
        if hasattr(before, name):
            np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_a_picture_that_does_not_fit_is_refused_before_it_is_rendered(monkeypatch):
    monkeypatch.setattr(_cpu, "expect_memory", lambda size: _refuse_above(2**30, size))
    with pytest.raises(MemoryError):
        wive.render(wive.Scene(*sphere(1)), width=65_536, height=65_536, spp=1)


def kind_of(scene: wive.Scene) -> tuple[str, str]:
    return "warp" if scene.backend == "warp" else "cpu", scene.precision


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("options", [{}, {"threads": 1}, {"threads": 7}, {"in_flight": 1}, {"lanes": 8}])
def test_max_bytes_is_exact_whatever_the_threads(backend, dtype, options):
    if ("lanes" in options) != (backend == "warp") and options:
        pytest.skip("an option of other backends")
    vertices, faces = soup(2000, seed=3, size=0.5)
    scene = wive.Scene(vertices.astype(dtype), faces, backend=backend)
    rays = random_rays(3000, seed=4, low=0, high=1)
    total = len(scene.intersect_all(*rays).t)
    assert total > 5000
    size = total * HIT_BYTES[kind_of(scene)]
    assert len(scene.intersect_all(*rays, max_bytes=size, **options).t) == total
    with pytest.raises(MemoryError) as error:
        scene.intersect_all(*rays, max_bytes=size - 1, **options)
    found = re.match(
        r"found (\d+) hits.* more than the limit of .*: pass fewer rays.*raise max_bytes$", str(error.value)
    )
    assert 0 < int(found[1]) <= total
    with pytest.raises(MemoryError):
        scene.intersect_all(*rays, max_bytes=1, stats=True, **options)
    assert len(scene.intersect_all(*rays).t) == total


def test_no_hits_take_no_bytes(backend):
    scene = wive.Scene(*TRIANGLE, backend=backend)
    assert len(scene.intersect_all([9, 9, 9], [1, 0, 0], max_bytes=1).t) == 0


@pytest.mark.parametrize(
    ("value", "kind"),
    [(0, ValueError), (-1, ValueError), (2**63, ValueError), (1.5, TypeError), ("1", TypeError)],
)
def test_a_limit_of_no_sense_is_refused(value, kind):
    with pytest.raises(kind, match=r"^max_bytes must be "):
        wive.Scene(*TRIANGLE).intersect_all([0, 0, 1], [0, 0, -1], max_bytes=value)


def stacked(count: int) -> tuple[np.ndarray, np.ndarray]:
    """`count` coincident triangles, all of which a ray along z hits."""
    return np.float32([[-1, -1, 0], [3, -1, 0], [-1, 3, 0]]), np.tile(np.int32([[0, 1, 2]]), (count, 1))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_all_threads_stop_when_the_limit_is_passed(dtype):
    """1e11 hits would take hours and 2.4 TB: found within the test's time limit only if all stop."""
    vertices, faces = stacked(100_000)
    scene = wive.Scene(vertices.astype(dtype), faces)
    origins = np.zeros((1_000_000, 3), dtype)
    origins[:, 2] = 1
    with pytest.raises(MemoryError, match=r"^found \d+ hits so far, .* more than the limit of 100\.0 MiB"):
        scene.intersect_all(origins, [0, 0, -1], max_bytes=100 * 2**20, threads=4)
    assert scene.count(origins[:3], [0, 0, -1]).tolist() == [100_000] * 3


CROWDED = """
import resource, sys
import numpy as np, wive
r = np.random.default_rng(0)
n = 60_000
v = (r.random((n, 1, 3)) + 0.02 * r.random((n, 3, 3))).reshape(-1, 3).astype(sys.argv[1])
f = np.arange(3 * n, dtype="i4").reshape(-1, 3)
o, d = r.random((60_000, 3)).astype(v.dtype), r.normal(size=(60_000, 3)).astype(v.dtype)
scene = wive.Scene(v, f)
expected = scene.intersect(o[:100], d[:100]).prim
works = {
    "build": lambda: wive.Scene(v, f),
    "high": lambda: wive.Scene(v[:30_000], f[:10_000], quality="high", nodes="compressed"),
    "refit": lambda: scene.refit(v),
    "intersect": lambda: scene.intersect(o, d, threads=16),
    "occluded": lambda: scene.occluded(o, d, threads=16),
    "count": lambda: scene.count(o, d, threads=16),
    "intersect_all": lambda: scene.intersect_all(o, d, threads=16),
}
if v.dtype == "f4":
    works["render"] = lambda: wive.render(scene, width=128, height=128, spp=4, threads=16)
answers = {name: set() for name in works}
for name, work in works.items():
    for step in range(14):
        used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + (step * step << 20), resource.RLIM_INFINITY))
        try:
            work()
            answers[name].add("done")
        except MemoryError as error:
            assert str(error) and "bad_alloc" not in str(error), repr(error)
            answers[name].add("MemoryError")
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
assert (scene.intersect(o[:100], d[:100]).prim == expected).all()
assert all("done" in answer for answer in answers.values()), answers
assert any("MemoryError" in answer for answer in answers.values()), answers
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_with_any_limit_of_the_address_space_work_is_done_or_a_memory_error(tmp_path, dtype):
    """Threads whose stacks don't fit are done without; nothing ends the process."""
    ran = subprocess.run(
        [sys.executable, "-c", CROWDED, dtype], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert ran.returncode == 0, ran.stderr


FEW_THREADS = """
import os, resource
import numpy as np, wive
from wive import _cpu
r = np.random.default_rng(0)
v = r.random((3000, 3)).astype("f4"); f = np.arange(3000, dtype="i4").reshape(-1, 3)
o = r.random((50_000, 3)).astype("f4")
scene = wive.Scene(v, f)
expected = scene.intersect(o, [0, 0, 1], threads=8).prim
wive.render(scene, width=8, height=8, spp=1)  # imports modules that another user may not read
if os.geteuid() == 0:  # whom no limit of processes holds
    os.setgid(65534); os.setuid(65534)
resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))
import threading
try:
    threading.Thread(target=int).start()
    raise SystemExit("the limit does not hold here")
except RuntimeError:
    pass
scene = wive.Scene(v, f)
assert (scene.intersect(o, [0, 0, 1], threads=8).prim == expected).all()
assert len(scene.intersect_all(o, [0, 0, 1], threads=8).counts) == len(o)
wive.render(scene, width=64, height=64, spp=1, threads=8)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="a limit of Linux")
def test_without_threads_the_calling_thread_does_the_work(tmp_path):
    ran = subprocess.run(
        [sys.executable, "-c", FEW_THREADS], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    if "does not hold" in ran.stderr:
        pytest.skip("this system does not limit the number of processes")
    assert ran.returncode == 0, ran.stderr
