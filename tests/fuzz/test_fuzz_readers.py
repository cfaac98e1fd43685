"""Files that are damaged in any way are read or refused in one line, in reasonable time and memory."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.mesh_files import damaged
from support.reader_targets import targets

TARGETS = targets()
PROGRAM = Path(__file__).with_name("fuzz_readers.py")


@pytest.mark.parametrize("name", TARGETS)
def test_damaged_files_are_read_or_refused(name: str, seeds: Iterator[int]) -> None:
    read, files = TARGETS[name]
    assert [read(file) for file in files] == [""] * len(files)
    refused, number = 0, 0
    for seed in seeds:
        random = np.random.default_rng(seed)
        for file in files:
            refused += read(damaged(file, random)) != ""
            number += 1
    assert refused > number // 3 - 20


def test_files_that_libfuzzer_makes_are_read_or_refused(tmp_path: Path) -> None:
    """A few, to see that the program runs; `.ci/fuzz` makes more."""
    pytest.importorskip("atheris", reason="atheris is not installed: pip install --group fuzz")
    command = [sys.executable, PROGRAM, "--format", "ply", "-runs=1000"]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout[-1000:] + ran.stderr[-2000:]
