"""What every bench leaves behind: a printed table, a JSON file with the machine it ran on, a PNG figure."""

import datetime
import importlib.metadata
import json
import platform
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.contenders.compiled_shim import BenchError, cache_folder, compiler_version, embreex_version

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPOSITORY = Path(__file__).resolve().parents[2]
RESULTS = REPOSITORY / "bench" / "results"
Row = dict[str, Any]


def environment() -> Row:
    """The machine and the versions that numbers were taken on."""
    import wive

    return {
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "cpu": _cpu_model(),
        "isa": _isa(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "wive": wive.__version__,
        "wive_compiler": _core_compiler(),
        "numpy": importlib.metadata.version("numpy"),
        "embreex": _or_none(embreex_version),
        "shim_compiler": _or_none(compiler_version),
        "commit": _commit(),
    }


def print_table(rows: Sequence[Row], columns: Sequence[str], title: str = "") -> None:
    """Rows as aligned text: numbers to the right, floats with three decimals, - where there is no value."""
    if not rows:
        return
    cells = [[_text(row.get(column)) for column in columns] for row in rows]
    widths = [max(map(len, column)) for column in zip(columns, *cells, strict=True)]
    numeric = [any(isinstance(row.get(column), int | float) for row in rows) for column in columns]

    def line(texts: Sequence[str]) -> str:
        padded = zip(texts, widths, numeric, strict=True)
        return "  ".join(
            text.rjust(width) if right else text.ljust(width) for text, width, right in padded
        ).rstrip()

    if title:
        print(f"\n{title}")
    print(line(columns))
    print("  ".join("-" * width for width in widths))
    for texts in cells:
        print(line(texts))


def print_progress(row: Row, columns: Sequence[str]) -> None:
    """One row as it comes in, on standard error."""
    print("  ".join(_text(row[column]) for column in columns), file=sys.stderr, flush=True)


def save(name: str, content: Row, figure: "Figure | None", folder: Path | None, *, whole: bool) -> Path:
    """Writes NAME.json and NAME.png; returns the JSON file's path.

    They go into the folder given; else a whole run's go into bench/results and a partial one's into the
    cache, so that it never replaces results that the docs quote.
    """
    folder = folder or (RESULTS if whole else cache_folder() / "partial")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.json"
    path.write_text(json.dumps({"bench": name, "environment": environment(), **content}, indent=1) + "\n")
    print(f"\nwrote {path}")
    if figure is not None:
        figure.savefig(path.with_suffix(".png"), dpi=130)
        print(f"wrote {path.with_suffix('.png')}")
    return path


def _text(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def _or_none(function: Any) -> Any:
    try:
        return function()
    except (BenchError, importlib.metadata.PackageNotFoundError):
        return None


def _core_compiler() -> str | None:
    from wive import _cpu

    compiler = getattr(_cpu, "compiler", None)
    return str(compiler() if callable(compiler) else compiler) if compiler is not None else None


def _proc_cpuinfo(field: str) -> str | None:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return None
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.split(":")[0].strip() == field), None
    )


def _cpu_model() -> str:
    """The model's name and, as virtual machines shorten it, its family and model numbers."""
    name = _proc_cpuinfo("model name")
    if name is None:
        return platform.processor() or platform.machine()
    return f"{name} (family {_proc_cpuinfo('cpu family')}, model {_proc_cpuinfo('model')})"


def _isa() -> list[str]:
    flags = (_proc_cpuinfo("flags") or "").split()
    return [flag for flag in flags if flag.startswith(("avx", "fma", "bmi"))]


def _commit() -> str | None:
    """HEAD's hash, with "+" where the tree has changes that are not in it."""

    def git(*arguments: str) -> str | None:
        answer = subprocess.run(
            ["git", "-C", str(REPOSITORY), *arguments], capture_output=True, text=True, check=False
        )
        return answer.stdout.strip() if answer.returncode == 0 else None

    head = git("rev-parse", "HEAD")
    return head and head + ("+" if git("status", "--porcelain") else "")
