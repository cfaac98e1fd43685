"""The output of every bench: a printed table, a JSON file with the machine it ran on, a figure of it."""

import datetime
import importlib.metadata
import json
import platform
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.contenders.compiled_shim import BenchError, cache_folder, compiler_version, embreex_version
from wive._internal.files import atomic_write

REPOSITORY = Path(__file__).resolve().parents[2]
RESULTS = REPOSITORY / "bench" / "results"
DOTS_PER_INCH = 160  # of figures
LONGEST_LINE = 110  # characters of a dict outside tables; in a longer one each key has a line of its own
Row = dict[str, Any]


def environment() -> Row:
    """The machine and the versions that the numbers belong to."""
    import wive
    from wive import _cpu

    return {
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "cpu": _cpu_model(),
        "isa": _isa(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "wive": wive.__version__,
        "wive_compiler": _cpu.compiler,
        "numpy": importlib.metadata.version("numpy"),
        "embreex": _or_none(embreex_version),
        "shim_compiler": _or_none(compiler_version),
        "commit": _commit(),
    }


def print_table(rows: Sequence[Row], columns: Sequence[str], title: str = "") -> None:
    """Prints rows as aligned text: numbers to the right, floats with three decimals, - for no value."""
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
    """Prints one row on standard error."""
    print("  ".join(_text(row[column]) for column in columns), file=sys.stderr, flush=True)


def save(name: str, content: Row, folder: Path | None, *, whole: bool) -> Path:
    """Writes NAME.json and its figure, NAME.png; returns the JSON file's path.

    They go into the folder given, or else into bench/results after a whole run and into the cache after a
    partial one, which must not replace results that the docs quote.
    """
    folder = folder or (RESULTS if whole else partial_folder())
    path = folder / f"{name}.json"
    write(path, {"bench": name, "environment": environment(), **content})
    print(f"\nwrote {path}")
    save_figure(name, content, folder)
    return path


def save_figure(name: str, content: Row, folder: Path) -> None:
    """Writes NAME.png, if the bench has a figure."""
    from bench import figures

    figure = figures.draw(name, content)
    if figure is None:
        return
    path = folder / f"{name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as file:
        figure.savefig(file, format="png", dpi=DOTS_PER_INCH, metadata={"Title": figure.get_suptitle()})
    print(f"wrote {path}")


def partial_folder() -> Path:
    """The folder for partial runs."""
    return cache_folder() / "partial"


def write(path: Path, content: Row) -> None:
    """Writes the content as JSON; creates the folder if there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, to_json(content))


def write_text(path: Path, text: str) -> None:
    """Writes a file of text, whole or not at all."""
    with atomic_write(path) as file:
        file.write(text.encode())


def to_json(content: Row) -> str:
    """JSON with one line per row of a table and per key of the rest, so that a diff shows what changed."""
    return _json(content, 0) + "\n"


def _json(value: object, depth: int) -> str:
    line = json.dumps(value)
    is_long = depth < 2 and len(line) > LONGEST_LINE
    if isinstance(value, dict) and (is_long or _holds_rows(value)):
        items = [f"{json.dumps(key)}: {_json(part, depth + 1)}" for key, part in value.items()]
    elif isinstance(value, list) and _holds_rows(value):
        items = [json.dumps(row) for row in value]
    else:
        return line
    indent = "\n" + " " * (depth + 1)
    return f"{line[0]}{indent}{f',{indent}'.join(items)}\n{' ' * depth}{line[-1]}"


def _holds_rows(value: object) -> bool:
    """Whether the value is a list of dicts or lists, or a dict that contains such a list at any depth."""
    if isinstance(value, dict):
        return any(_holds_rows(part) for part in value.values())
    return isinstance(value, list) and any(isinstance(item, dict | list) for item in value)


def _text(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def _or_none(function: Any) -> Any:
    try:
        return function()
    except (BenchError, importlib.metadata.PackageNotFoundError):
        return None


def _proc_cpuinfo(field: str) -> str | None:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return None
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.split(":")[0].strip() == field), None
    )


def _cpu_model() -> str:
    """The model's name, and its family and model numbers, as virtual machines shorten the name."""
    name = _proc_cpuinfo("model name")
    if name is None:
        return platform.processor() or platform.machine()
    return f"{name} (family {_proc_cpuinfo('cpu family')}, model {_proc_cpuinfo('model')})"


def _isa() -> list[str]:
    flags = (_proc_cpuinfo("flags") or "").split()
    return [flag for flag in flags if flag.startswith(("avx", "fma", "bmi"))]


def _commit() -> str | None:
    """HEAD's hash, with "+" if the working tree has other changes."""

    def git(*arguments: str) -> str | None:
        command = ["git", "-C", str(REPOSITORY), *arguments]
        try:
            answer = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError:
            return None
        return answer.stdout.strip() if answer.returncode == 0 else None

    head = git("rev-parse", "HEAD")
    return head and head + ("+" if git("status", "--porcelain") else "")
