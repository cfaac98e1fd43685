"""The programs in README.md and in the pages of docs/ run as they are printed."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHON_BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


def programs(page: str) -> list[str]:
    """The page's Python blocks."""
    return PYTHON_BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


def run(program: str, folder: Path) -> str:
    """What the program prints; from a file, since Warp reads the source of kernels."""
    path = folder / "program.py"
    path.write_text(program, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "error", str(path)],
        cwd=folder, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_readmes_program_runs(tmp_path: Path) -> None:
    (program,) = programs("README.md")
    printed = run(program, tmp_path).strip()
    assert printed == "[ 1.  1. inf] [ 0  1 -1]"
    assert program.endswith(f"# {printed}\n")


@pytest.mark.parametrize("program", programs("docs/libraries.md"))
def test_the_libraries_pages_programs_print_what_they_say(program: str, tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    said = re.findall(r"print\(.*?\)  # ([^:\n]*)", program)
    assert run(program, tmp_path).splitlines() == said


@pytest.mark.parametrize("number", range(len(programs("docs/warp.md"))))
def test_the_warp_pages_programs_run(number: int, tmp_path: Path, device: str) -> None:
    program = programs("docs/warp.md")[number]
    if "import torch" in program:
        pytest.importorskip("torch")
    assert run(program, tmp_path) != ""


PAGES = "docs/pictures.md", "docs/sensors.md", "docs/several_meshes.md", "docs/terrain.md"
PROGRAMS = [(page, i) for page in PAGES for i in range(len(programs(page)))]


@pytest.mark.parametrize(("page", "number"), PROGRAMS)
def test_programs_of_pages_print_what_they_say(page: str, number: int, tmp_path: Path) -> None:
    program = programs(page)[number]
    printed = run(program, tmp_path).strip()
    assert program.endswith(f"# {printed}\n")
