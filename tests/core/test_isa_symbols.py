"""Code of one instruction set can't be linked into another's: the check that CI's build runs on kernels."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CPU = Path(__file__).resolve().parents[2] / "cpu"
COMPILER, NM = shutil.which("c++"), shutil.which("nm")
UNIT = """
#include "traverse/stack.h"
namespace wive::avx2 {
template <class T> T own(T x) { return x + 1; }
}
namespace wive {
template <class T> [[gnu::always_inline]] inline T inlined(T x) { return x * 3; }
int (*volatile table)(int);
%s
void fill() { table = avx2::own<int>; table = [](int x) { return inlined(x); }; }
}
"""
SLIP = "inline int slip(int x) { return x * 2; }\nvoid plant() { table = slip; }"


@pytest.mark.skipif(COMPILER is None or NM is None, reason="needs a C++ compiler and nm (binutils)")
@pytest.mark.parametrize(("planted", "status"), [("", 0), (SLIP, 1)])
def test_a_function_that_instruction_sets_could_share_is_found(
    planted: str, status: int, tmp_path: Path
) -> None:
    source, unit = tmp_path / "unit.cpp", tmp_path / "unit.o"
    source.write_text(UNIT % planted)
    flags = ["-std=c++20", "-O2", "-DWIVE_ISA=avx2", f"-I{CPU}"]
    subprocess.run([str(COMPILER), *flags, "-c", str(source), "-o", str(unit)], check=True)
    check = [sys.executable, str(CPU / "kernels" / "check_isa_symbols.py"), str(NM), f"avx2:{unit}"]
    answer = subprocess.run(check, capture_output=True, text=True, check=False)
    assert answer.returncode == status, answer.stderr
    assert ("slip" in answer.stderr) == (status == 1)
