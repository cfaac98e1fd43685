"""Files that libFuzzer makes, led by the code that they reach: read, or refused in one line.

    pip install --group fuzz
    python tests/fuzz/fuzz_readers.py --format ply --minutes 60

`--format` is a name in `reader_targets.targets`; without it, each runs for its share of the time, all of them
even if one fails. Other arguments go to libFuzzer. Files that reached new code are kept in build/fuzz/FORMAT,
where the next run begins. A file that fails is kept as build/fuzz/FORMAT-crash-..., and is read again by
`--format FORMAT THE_FILE`: make it small and add it to a test of tests/api.
"""

import argparse
import io
import re
import resource
import subprocess
import sys
from contextlib import redirect_stderr
from pathlib import Path
from typing import NoReturn

import atheris

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))
with redirect_stderr(io.StringIO()), atheris.instrument_imports(include=["wive"]):
    from support.mesh_files import WORDS
    from support.reader_targets import Target, targets

    TARGETS = targets()
    for target in TARGETS.values():  # import the readers
        target.read(target.seeds[0])

FOLDER = ROOT / "build" / "fuzz"
# What a file of some thousand bytes may take at most: seconds, while its reader is traced, and bytes.
SECONDS, BYTES = 30, 1 << 30
START = 3  # seconds that a process takes before it begins
WORD = re.compile(rb"[A-Za-z_#:/.]{2,40}")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--format", choices=TARGETS)
    parser.add_argument("--minutes", type=float)
    given, rest = parser.parse_known_args()
    if given.minutes is not None:
        share = 60 * given.minutes / (1 if given.format else len(TARGETS))
        rest.append(f"-max_total_time={max(1, round(share) - START)}")
    if given.format is not None:
        fuzz(given.format, TARGETS[given.format], rest)
    runs = {each: subprocess.run([sys.executable, __file__, "--format", each, *rest]) for each in TARGETS}
    failed = [each for each, run in runs.items() if run.returncode]
    print(f"failed: {', '.join(failed)}" if failed else f"{len(runs)} formats: no failure")
    return len(failed)


def fuzz(name: str, target: Target, arguments: list[str]) -> NoReturn:
    """Run libFuzzer, which ends the process."""
    found, seeds = FOLDER / name, FOLDER / "seeds" / name
    for folder in (found, seeds):
        folder.mkdir(parents=True, exist_ok=True)
    for at, seed in enumerate(target.seeds):
        (seeds / str(at)).write_bytes(seed)
    words = {*WORDS, *(word for seed in target.seeds for word in WORD.findall(seed))}
    dictionary = FOLDER / f"{name}.dict"
    dictionary.write_text("".join(f'"{quoted(word)}"\n' for word in sorted(words)))
    print(f"{name}: {len(target.seeds)} seeds", flush=True)
    options = [f"-timeout={SECONDS}", f"-dict={dictionary}", f"-artifact_prefix={found}-"]
    options += ["-verbosity=0", "-print_final_stats=1", *arguments]
    if not any(Path(argument).is_file() for argument in arguments):
        options += [str(found), str(seeds)]
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, resource.RLIM_INFINITY))
    atheris.Setup([sys.argv[0], *options], target.read)
    atheris.Fuzz()
    raise SystemExit(0)


def quoted(word: bytes) -> str:
    """The word as libFuzzer's dictionaries write it."""
    return "".join(f"\\x{byte:02x}" for byte in word)


if __name__ == "__main__":
    sys.exit(main())
