"""The bench against other libraries, with a stand-in for their sources."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytest.importorskip("trimesh")

STAND_IN = ROOT / "tests" / "support" / "stand_in_tiny_bvh.h"


def run(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    common = ["--quick", "--scenes", "terrain_2k", "--out", str(folder)]
    return subprocess.run(
        [sys.executable, "-m", "bench", "peers", *common, *options], cwd=ROOT, capture_output=True, text=True,
        env={**os.environ, "XDG_CACHE_HOME": str(folder)}, timeout=240, check=False,
    )  # fmt: skip


def test_a_folder_without_the_peers_sources_is_named(tmp_path: Path) -> None:
    answer = run(tmp_path, "--tinybvh", str(tmp_path))
    assert answer.returncode == 2
    assert f"{tmp_path}: expected the sources of tinybvh, with tiny_bvh.h" in answer.stderr
    answer = run(tmp_path)
    assert answer.returncode == 2 and "--tinybvh FOLDER or --bvh FOLDER" in answer.stderr


@pytest.mark.slow
def test_the_peers_hits_are_compared_and_its_builders_measured(tmp_path: Path) -> None:
    shutil.copy(STAND_IN, tmp_path / "tiny_bvh.h")
    answer = run(tmp_path, "--tinybvh", str(tmp_path))
    if "no C++ compiler" in answer.stderr or "compiled for AVX2" in answer.stderr:
        pytest.skip(answer.stderr.strip().splitlines()[-1])
    assert answer.returncode == 0, answer.stderr
    content = json.loads((tmp_path / "peers.json").read_text())
    for builder in ("usual", "high"):
        kinds = [row["rays"] for row in content["rows"] if row["builder"] == builder]
        assert kinds == ["primary", "diffuse", "shadow", "random"]
    for row in content["rows"]:
        assert row["mismatches"] <= 1000  # per million
        assert row["watertight"] > 1  # all triangles for each ray
    assert content["builds"][0]["usual_seconds"] > 0
