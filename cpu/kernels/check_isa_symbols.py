"""Fails if code of one instruction set could be linked into another's: run on the kernels' objects.

The linker keeps one copy of an inline function or a template, whichever unit it came from, and that copy may
use instructions that this machine lacks. So the weak functions of a unit must have its namespace, wive::avx2
for instance, in their names; functions that are always inlined leave no symbol.
"""

import subprocess
import sys
from collections.abc import Iterator, Sequence


def shared_functions(nm: str, isa: str, objects: Sequence[str]) -> Iterator[str]:
    """Weak functions that the objects define outside the namespace of their instruction set."""
    own = f"{len(isa)}{isa}"  # a mangled name holds each identifier behind its length
    symbols = subprocess.run([nm, "-A", *objects], capture_output=True, text=True, check=True).stdout
    for line in symbols.splitlines():
        kind, name = line.split()[-2:]
        if kind == "W" and own not in name:
            yield line


def main(nm: str, *objects: str) -> int:
    """Arguments: nm, then for each instruction set its name, a colon and an object. The exit status."""
    found = []
    for each in objects:
        isa, _, path = each.partition(":")
        found += shared_functions(nm, isa, [path])
    if found:
        print(
            "These could be linked into code of another instruction set:", *found, sep="\n", file=sys.stderr
        )
        print("Put them in namespace wive::WIVE_ISA, or make them always inlined.", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
