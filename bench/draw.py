"""Draws the figures of bench/results again, from the JSON files there, without measuring anything."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from bench.contenders.compiled_shim import BenchError
from bench.figures import DRAWN
from bench.support import report
from bench.support.options import listed


def main(options: Sequence[str]) -> None:
    """Draws the figures that are named, or all."""
    parser = argparse.ArgumentParser(prog="python -m bench draw", description=__doc__)
    parser.add_argument("names", type=listed(DRAWN), nargs="*", help=f"{', '.join(DRAWN)}; default: all")
    parser.add_argument("--results", type=Path, default=report.RESULTS, help="the folder of JSON files")
    parser.add_argument("--out", type=Path, help="folder for figures; default: that of the JSON files")
    chosen = parser.parse_args(options)
    names = [name for group in chosen.names for name in group]
    for name in names or DRAWN:
        path = chosen.results / f"{name}.json"
        if path.exists():
            report.save_figure(name, json.loads(path.read_text()), chosen.out or chosen.results)
        elif names:
            raise BenchError(f"no results in {path}: run `python -m bench {name}`")
