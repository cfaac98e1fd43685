"""`bench gpu` runs on the CPU device, saves each section, and its steps on another machine fail early."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.gpu import prepare, rays, streams
from bench.gpu.attempts import ATTEMPTS, Attempt, Case, hard_case

pytest.importorskip("warp")
ROOT = Path(__file__).resolve().parents[2]
STEPS = ROOT / "bench" / "gpu" / "steps.sh"


def crashes(case: Case) -> dict[str, int]:
    os.abort()


@pytest.fixture
def triangle() -> Case:
    return hard_case(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), "cpu", 30)


def test_every_section_is_saved_and_the_hits_are_the_cores(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "bench", "gpu", "--device", "cpu", "--quick", "--scenes", "terrain_2k"]
    answer = subprocess.run(
        [*command, "--only", "about,right,basics,shadow", "--out", str(tmp_path)],
        cwd=ROOT, capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    content: dict[str, Any] = json.loads((tmp_path / "gpu-cpu.json").read_text())
    assert list(content) == ["bench", "environment", "about", "right", "basics", "shadow"]
    assert content["right"]["bad"] == 0
    assert [row["wrong"] for row in content["right"]["rows"]] == [{}]
    assert all(row["wive_mrays"] > 0 for row in content["shadow"])


def test_an_unknown_device_ends_in_one_line() -> None:
    answer = subprocess.run(
        [sys.executable, "-m", "bench", "gpu", "--device", "nowhere", "--scenes", "terrain_2k"],
        cwd=ROOT, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert answer.returncode == 2
    assert "bench gpu: no Warp device 'nowhere'" in answer.stderr


def test_an_attempt_that_crashes_is_a_result(triangle: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(streams.alone("no such attempt", triangle, 60)) == {"failed"}
    monkeypatch.setitem(ATTEMPTS, "crashes", Attempt(crashes, needs_gpu=False))
    assert "failed" in streams.alone("crashes", triangle, 60)


def test_tiles_are_neighbours_and_every_pixel_is_in_one() -> None:
    order = rays.tile_order(16)
    assert sorted(order) == list(range(256))
    rows, columns = np.divmod(order.reshape(-1, 32), 16)
    assert (np.ptp(rows, axis=1) == 3).all() and (np.ptp(columns, axis=1) == 7).all()


def test_a_wheel_is_trimmed_and_cut_into_pieces_that_make_it_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = {"warp/__init__.py": b"", "warp/bin/warp.so": np.random.default_rng(1).bytes(3000)}
    with zipfile.ZipFile(tmp_path / "warp.whl", "w") as wheel:
        for name, data in {**kept, "warp/bin/warp-clang.so": b"x", "warp/tests/test.py": b"x"}.items():
            wheel.writestr(name, data)
    monkeypatch.setattr(prepare, "LARGEST_PIECE", 1500)
    pieces = prepare.cut(prepare.trimmed(tmp_path / "warp.whl", tmp_path), tmp_path)
    assert pieces == ["warp.1-of-3", "warp.2-of-3", "warp.3-of-3"]
    joined = tmp_path / "joined.zip"
    joined.write_bytes(b"".join((tmp_path / piece).read_bytes() for piece in pieces))
    with zipfile.ZipFile(joined) as whole:
        assert {name: whole.read(name) for name in whole.namelist()} == kept
    printed = prepare.steps(Path("packed"), pieces).splitlines()
    assert [line.split("steps.sh ")[1].split()[0] for line in printed] == ["start", "piece", "run", "run"]


@pytest.fixture
def machine(tmp_path: Path) -> Any:
    """Runs a step in a small repository, with a Python that only notes how it was called."""
    root = tmp_path / "root"
    (root / "bench" / "gpu").mkdir(parents=True)
    (root / "bench" / "gpu" / "steps.sh").write_text(STEPS.read_text())
    (root / "packed" / "scenes").mkdir(parents=True)
    fake = tmp_path / "python"
    fake.write_text(
        '#!/bin/sh\ncase "$2" in pip) sleep ${PIP_SECONDS:-0};; zipfile) mkdir "$5/warp";; esac\n'
        f'echo "$@" >> {tmp_path}/calls\n'
    )
    fake.chmod(0o755)

    def run(step: str, *options: str, **variables: str) -> subprocess.CompletedProcess[str]:
        known = {"WIVE_GPU_WORK": str(tmp_path / "work"), "WIVE_GPU_WAIT": "20", "PYTHON": str(fake)}
        return subprocess.run(
            ["sh", "bench/gpu/steps.sh", step, "packed", *options],
            cwd=root, env={**os.environ, **known, **variables},
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip

    run.root, run.calls = root, tmp_path / "calls"
    return run


def test_steps_keep_the_pieces_and_run_the_bench_after_the_build(machine: Any) -> None:
    packed = machine.root / "packed"
    for number, step in enumerate(("start", "piece", "run"), start=1):
        piece = packed / f"warp.{number}-of-3"
        piece.write_text(f"piece {number}")
        answer = machine(step, *(("--only", "about") if step == "run" else ()), PIP_SECONDS="1")
        assert answer.returncode == 0, answer.stderr
        piece.unlink()
    calls = machine.calls.read_text().splitlines()
    assert [call.split()[1] for call in calls] == ["pip", "zipfile", "bench"]
    assert calls[2].endswith("/scenes --only about")
    assert machine("run").returncode == 0  # once more, without pieces


@pytest.mark.parametrize("step", ["piece", "run"])
def test_a_step_before_the_build_was_started_fails_at_once(machine: Any, step: str) -> None:
    answer = machine(step)
    assert answer.returncode == 1
    assert "the build has not been started" in answer.stderr


def test_the_wait_for_the_build_has_a_limit(machine: Any) -> None:
    (machine.root / "packed" / "warp.1-of-1").write_text("")
    assert machine("start", PIP_SECONDS="5").returncode == 0
    answer = machine("run", WIVE_GPU_WAIT="1")
    assert answer.returncode == 1
    assert "the build has not ended after 1 s" in answer.stderr


def test_a_missing_piece_is_named(machine: Any) -> None:
    (machine.root / "packed" / "warp.1-of-2").write_text("")
    assert machine("start").returncode == 0
    answer = machine("run")
    assert answer.returncode == 1
    assert "there are 1 of 2 pieces of Warp" in answer.stderr
