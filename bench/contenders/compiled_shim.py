"""Compiles the benches' C++ and finds Embree's library in the embreex wheel."""

import ctypes
import hashlib
import importlib.metadata
import os
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

EMBREE_SHIM = Path(__file__).parents[1] / "native" / "embree_shim.cpp"
FLAGS = ["-O2", "-std=c++17", "-shared", "-fPIC"]


class BenchError(RuntimeError):
    """Something that the machine lacks; the text names it in one line."""


def cache_folder() -> Path:
    """The folder of compiled shims and recorded rays: $XDG_CACHE_HOME/wive-bench."""
    base = os.environ.get("XDG_CACHE_HOME")
    folder = (Path(base) if base else Path.home() / ".cache") / "wive-bench"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def embree_library() -> Path:
    """Path of the Embree 4 shared library in the installed embreex wheel."""
    try:
        files = importlib.metadata.files("embreex") or []
    except importlib.metadata.PackageNotFoundError:
        raise BenchError("embreex is not installed: pip install embreex (x86-64 only)") from None
    for file in files:
        if file.name.startswith("libembree4"):
            return Path(str(file.locate())).resolve()
    raise BenchError(
        "the installed embreex carries no libembree4 shared library: install its wheel from PyPI"
    )


def embreex_version() -> str:
    """Version of the installed embreex wheel."""
    return importlib.metadata.version("embreex")


def compiler() -> list[str]:
    """The C++ compiler's command: $CXX, else c++."""
    command = shlex.split(os.environ.get("CXX", "c++"))
    if not command or shutil.which(command[0]) is None:
        raise BenchError(f"no C++ compiler {command[0] if command else ''!r}: install one or set CXX")
    return command


def compiler_version() -> str:
    """The first line of the compiler's --version."""
    answer = subprocess.run([*compiler(), "--version"], capture_output=True, text=True, check=False)
    return (answer.stdout.splitlines() or ["unknown"])[0]


def compiled(*sources: Path, flags: Sequence[str] = FLAGS, headers: Sequence[Path] = ()) -> Path:
    """Path of the sources as one shared library, built if it does not exist yet for this text and compiler.

    headers: folders with the headers that the sources include, which are part of the text.
    """
    included = sorted(header for folder in headers for header in folder.rglob("*.h"))
    texts = [path.read_text() for path in (*sources, *included)]
    key = "\n".join([*texts, compiler_version(), *compiler(), *flags])
    target = cache_folder() / f"{sources[0].stem}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.so"
    if not target.exists():
        draft = target.with_suffix(f".{os.getpid()}.tmp")
        command = [*compiler(), *flags, *map(str, sources), "-o", str(draft), "-ldl"]
        answer = subprocess.run(command, capture_output=True, text=True, check=False)
        if answer.returncode:
            reason = next(
                (line for line in answer.stderr.splitlines() if "error" in line), answer.stderr.strip()
            )
            raise BenchError(f"{sources[0].name} does not compile: {reason}")
        draft.replace(target)
    return target


def open_shim() -> ctypes.CDLL:
    """The shim, with Embree's library opened behind it."""
    library = embree_library()
    shim = ctypes.CDLL(str(compiled(EMBREE_SHIM)))
    shim.shim_open.restype = ctypes.c_char_p
    problem: bytes | None = shim.shim_open(str(library).encode())
    if problem is not None:
        raise BenchError(f"can't open Embree: {problem.decode()}")
    return shim
