"""The programs of docs/dask.md run as they are printed."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.meshes import random_rays, soup

import wive

PAGE = Path(__file__).resolve().parents[2] / "docs" / "dask.md"
DASK, TRACING, JOBLIB, _ = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def run(program: str, folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder, capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_first_program_traces_rays_made_in_chunks(tmp_path):
    pytest.importorskip("dask.array")
    corners = [[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 2], [9, 0, 2], [0, 9, 2]]
    wive.Scene(corners, [[0, 1, 2], [3, 4, 5]]).save(tmp_path / "city.wive")
    program = DASK.replace("000_000", "000")
    assert program != DASK
    seen = re.fullmatch(r"(\d+) rays hit, after 1\.0 on average\n", run(program, tmp_path))
    assert seen and 1900 < int(seen[1]) < 2100


def test_joblib_traces_on_two_processes(tmp_path):
    pytest.importorskip("joblib")
    scene = wive.Scene(*soup(500, seed=7))
    scene.save(tmp_path / "city.wive")
    origins, directions = random_rays(1000, seed=6)
    np.save(tmp_path / "origins.npy", origins)
    np.save(tmp_path / "directions.npy", directions)
    (tmp_path / "tracing.py").write_text(TRACING)
    run(JOBLIB, tmp_path)
    np.testing.assert_array_equal(np.load(tmp_path / "t.npy"), scene.intersect(origins, directions).t)
