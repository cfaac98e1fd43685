"""The programs in the pages of docs/ run as they are printed, and print what the pages say."""

from pathlib import Path

import pytest
from support.pages import ROOT, packages, programs, run, said

OWN_TEST = {"docs/dask.md"}  # its programs need files and each other's modules
PAGES = sorted({path.relative_to(ROOT).as_posix() for path in ROOT.glob("docs/**/*.md")} - OWN_TEST)
PROGRAMS = [(page, number) for page in PAGES for number in range(len(programs(page)))]


@pytest.mark.parametrize(("page", "number"), PROGRAMS)
def test_programs_of_pages_print_what_they_say(page: str, number: int, tmp_path: Path) -> None:
    program = programs(page)[number]
    for package in sorted(packages(program)):
        pytest.importorskip(package)
    printed = iter(run(program, tmp_path))
    for line in said(program):
        assert line in printed, f"{page} says that {line!r} is printed"


def test_programs_are_told_apart_by_their_imports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```python\nimport wive\n```\ntext\n```python\nx = 1\n```\n```python\nfrom os import sep\n```\n"
    )
    monkeypatch.setattr("support.pages.ROOT", tmp_path)
    assert programs("page.md") == ["import wive\nx = 1\n", "from os import sep\n"]


def test_what_a_page_says_is_found_behind_prints() -> None:
    assert said("print(x)  # 4: all hits\nif x:\n    print(y)  # [1 2]\nz = 3  # three\n") == ["4", "[1 2]"]


def test_packages_of_a_program_are_those_that_are_installed() -> None:
    assert packages("import os\nimport numpy as np\nimport trimesh\nfrom wive import warp_kernels\n") == {
        "trimesh",
        "warp",
    }
