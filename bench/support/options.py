"""Command-line options that benches share."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

Accuracy = Literal["fast", "watertight"]
Nodes = Literal["float32", "compressed"]
Quality = Literal["medium", "high"]

ACCURACIES: tuple[Accuracy, ...] = ("fast", "watertight")  # Embree has a counterpart to each
NODES: tuple[Nodes, ...] = ("float32", "compressed")
QUALITIES: tuple[Quality, ...] = ("medium", "high")


def listed(choices: Sequence[str] = ()) -> Callable[[str], tuple[str, ...]]:
    """A parser of names with commas between them, each one of the choices if any are given."""

    def names(text: str) -> tuple[str, ...]:
        found = tuple(name.strip() for name in text.split(",") if name.strip())
        for name in found:
            if choices and name not in choices:
                raise argparse.ArgumentTypeError(f"no {name!r} among {', '.join(choices)}")
        if not found:
            raise argparse.ArgumentTypeError("expected names with commas between them")
        return found

    return names


def numbers(text: str) -> tuple[int, ...]:
    """Positive integers with commas between them."""
    try:
        found = tuple(int(part) for part in text.split(","))
    except ValueError:
        found = ()
    if not found or min(found) < 1:
        raise argparse.ArgumentTypeError(f"expected positive integers with commas between them, got {text!r}")
    return found


def in_flights(text: str) -> tuple[int, ...]:
    """Numbers of rays in flight with commas between them; "tuned" is 0, which lets the core choose."""
    return tuple(0 if part.strip() == "tuned" else numbers(part)[0] for part in text.split(","))


def scene_parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """A parser with the options of every bench over scenes."""
    parser = result_parser(name, description)
    parser.add_argument(
        "--scenes", type=listed(), default=(), help="names of scenes, with commas between them"
    )
    parser.add_argument("--scene-dir", type=Path, help="folder of scenes (docs/scenes.md)")
    return parser


def result_parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """A parser with the options of every bench."""
    summary = (description or "").split("\n")[0]
    parser = argparse.ArgumentParser(prog=f"python -m bench {name}", description=summary)
    parser.add_argument(
        "--quick",
        action="store_true",
        help="few rays and rounds: shows that the bench runs, measures nothing",
    )
    parser.add_argument(
        "--out", type=Path, help="folder for results; default bench/results, for partial runs one in ~/.cache"
    )
    return parser
