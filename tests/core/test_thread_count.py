"""How many threads calls use: what is asked, set, allowed by quotas, and not in use by other calls."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from support.meshes import sphere

import wive
from wive import _cpu

ASK = "import wive; print(wive._cpu.thread_count())"


@pytest.fixture
def setting():
    yield
    wive.set_threads(None)


def test_the_number_set_is_that_of_calls_that_ask_for_none(setting: None) -> None:
    wive.set_threads(3)
    assert _cpu.thread_count() == 3
    assert _cpu.thread_count(5) == 5
    wive.set_threads(None)
    assert 1 <= _cpu.thread_count() <= _cpu.usable_cores()


@pytest.mark.parametrize("count", [0, -1, 1.5, "2", True])
def test_a_number_that_is_no_count_is_refused(setting: None, count: object) -> None:
    with pytest.raises((ValueError, TypeError), match=r"^threads must be"):
        wive.set_threads(count)  # type: ignore[arg-type]


@pytest.mark.parametrize(("text", "answer"), [("3", "3"), (" 7 ", "7"), ("", None)])
def test_the_environment_sets_it(text: str, answer: str | None, tmp_path: Path) -> None:
    environment = {**os.environ, "WIVE_NUM_THREADS": text}
    found = subprocess.run(
        [sys.executable, "-c", ASK], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout.strip()
    assert found == (answer or str(_cpu.usable_cores()))


def test_an_environment_that_holds_no_number_is_one_line(tmp_path: Path) -> None:
    environment = {**os.environ, "WIVE_NUM_THREADS": "all"}
    answer = subprocess.run(
        [sys.executable, "-c", ASK],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert answer.returncode == 1
    assert answer.stderr.splitlines()[-1] == (
        "ValueError: WIVE_NUM_THREADS must be a positive integer, got 'all': change it or unset it"
    )


def test_quotas_of_control_groups_limit_the_cores(tmp_path: Path) -> None:
    cores = _cpu.usable_cores(str(tmp_path))
    (tmp_path / "proc" / "self").mkdir(parents=True)
    (tmp_path / "proc" / "self" / "cgroup").write_text("4:cpu,cpuacct:/job\n0::/slice/task\n")
    version_1, version_2 = tmp_path / "sys/fs/cgroup/cpu/job", tmp_path / "sys/fs/cgroup/slice"
    version_1.mkdir(parents=True)
    (version_2 / "task").mkdir(parents=True)
    assert _cpu.usable_cores(str(tmp_path)) == cores
    (version_2 / "task" / "cpu.max").write_text("max 100000\n")
    assert _cpu.usable_cores(str(tmp_path)) == cores
    (version_2 / "cpu.max").write_text("140000 100000\n")  # of the group around it
    assert _cpu.usable_cores(str(tmp_path)) == min(cores, 2)
    (version_2 / "cpu.max").write_text("20000 100000\n")
    assert _cpu.usable_cores(str(tmp_path)) == 1
    (version_2 / "cpu.max").unlink()
    (version_1 / "cpu.cfs_quota_us").write_text("-1\n")
    (version_1 / "cpu.cfs_period_us").write_text("100000\n")
    assert _cpu.usable_cores(str(tmp_path)) == cores
    (version_1 / "cpu.cfs_quota_us").write_text("100000\n")
    assert _cpu.usable_cores(str(tmp_path)) == 1


def test_calls_at_once_share_the_cores() -> None:
    scene = wive.Scene(*sphere(5))
    directions = np.random.default_rng(3).standard_normal((300_000, 3)).astype(np.float32)
    origins = np.zeros(3, np.float32)
    ended = threading.Event()

    def trace() -> None:
        while not ended.is_set():
            scene.intersect(origins, directions)

    other = threading.Thread(target=trace)
    other.start()
    try:
        deadline = time.monotonic() + 60
        while _cpu.thread_count() > 1:
            assert time.monotonic() < deadline
    finally:
        ended.set()
        other.join()
    assert _cpu.thread_count() == _cpu.usable_cores()


@pytest.mark.parametrize("threads", [1, 2])
def test_threads_that_build_are_as_many_as_asked(threads, monkeypatch, tmp_path):
    built = []
    real = _cpu.Bvh

    def bvh(*args, **options):
        built.append(options["threads"])
        return real(*args, **options)

    monkeypatch.setattr(_cpu, "Bvh", bvh)
    vertices, faces = sphere(2)
    scene = wive.Scene(vertices, faces, threads=threads)
    wive.Scene.from_meshes([(vertices, faces)] * 2, threads=threads)
    wive.Scene.from_heightfield(np.zeros((9, 9)), np.arange(9), np.arange(9), threads=threads)
    scene.save(tmp_path / "saved")
    wive.Scene.from_file(tmp_path / "saved", threads=threads)  # builds nothing
    wive.Scene.from_file(tmp_path / "saved", accuracy="fast", threads=threads)
    assert built == [threads] * 4
    scene.refit(vertices + np.float32(1), threads=threads)
    assert scene.bounds[0].min() == (vertices + np.float32(1)).min()


@pytest.mark.parametrize("call", ["scene", "from_file", "refit"])
@pytest.mark.parametrize("threads", [0, -1, 1.5, "2"])
def test_a_bad_number_of_threads_that_build_is_one_line(call, threads, tmp_path):
    scene = wive.Scene(*sphere(1))
    scene.save(tmp_path / "saved")
    calls = {
        "scene": lambda: wive.Scene(*sphere(1), threads=threads),
        "from_file": lambda: wive.Scene.from_file(tmp_path / "saved", threads=threads),
        "refit": lambda: scene.refit(scene.vertices, threads=threads),
    }
    with pytest.raises((ValueError, TypeError), match=r"^threads must be[^\n]*$"):
        calls[call]()
