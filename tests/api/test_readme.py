"""The program in README.md runs as it is printed."""

from pathlib import Path

from support.pages import programs, run


def test_the_readmes_program_runs(tmp_path: Path) -> None:
    (program,) = programs("README.md")
    printed = run(program, tmp_path)
    assert printed == ["[ 1.  1. inf] [ 0  1 -1]"]
    assert program.endswith(f"# {printed[0]}\n")
