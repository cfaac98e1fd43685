"""The programs that pages print, and what they say that these print."""

import ast
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYTHON_BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
# A warning is an error, but for Warp's on Python 3.10.
WARNINGS = "-Werror", "-Wignore:Support for Python 3.10 is deprecated:FutureWarning"
PRINTED = re.compile(r"^ *print\(.*\)  # (.*)$", re.MULTILINE)


def blocks(page: str) -> list[str]:
    """The page's Python blocks."""
    return PYTHON_BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


def programs(page: str) -> list[str]:
    """The page's programs: a block that does not begin with imports continues the program before it."""
    found: list[str] = []
    for block in blocks(page):
        if found and not block.startswith(("import ", "from ")):
            found[-1] += block
        else:
            found.append(block)
    return found


def said(program: str) -> list[str]:
    """What its lines `print(...)  # text` say that they print; the text behind ": " explains."""
    return [text.split(": ")[0] for text in PRINTED.findall(program)]


def packages(program: str) -> set[str]:
    """The packages that it needs beside Python's own, NumPy and wive."""
    modules = [node for node in ast.walk(ast.parse(program)) if isinstance(node, ast.Import | ast.ImportFrom)]
    names = [alias.name for node in modules if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in modules if isinstance(node, ast.ImportFrom) and node.module]
    tops = {name.partition(".")[0] for name in names} | ({"warp"} if "warp" in program else set())
    return tops - sys.stdlib_module_names - {"numpy", "wive"}


def run(program: str, folder: Path) -> list[str]:
    """The lines that the program prints; from a file, since Warp reads the source of kernels."""
    path = folder / "program.py"
    path.write_text(program, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, *WARNINGS, str(path)],
        cwd=folder, capture_output=True, text=True, timeout=280, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
