"""The programs in examples/ that need no device print what is so by other means."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def numbers(name: str, folder: Path) -> list[float]:
    """The numbers that an example prints."""
    done = subprocess.run(
        [sys.executable, "-W", "error", str(EXAMPLES / name)],
        cwd=folder, capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return [float(number) for number in re.findall(r"\d+\.?\d*", done.stdout)]


def test_walls_of_a_casing_are_as_thick_as_it_was_made(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    thinnest, _, share, by_points, by_theorem = numbers("wall_thickness.py", tmp_path)
    outer, cavity = 2 * (40 * 30 + 30 * 20 + 20 * 40), 2 * (32 * 22 + 22 * 12 + 12 * 32)
    thin = 2 * (32 * 22 + 22 * 12)  # two walls of 2, seen from either side
    assert thinnest == 2
    assert share == pytest.approx(100 * thin / (outer + cavity), rel=0.02)
    assert by_theorem == 40 * 30 * 20 - 32 * 22 * 12
    assert by_points == pytest.approx(by_theorem, rel=0.005)
