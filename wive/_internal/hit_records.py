"""What is written down about hits in a file: how far an interrupted run is, and what a complete one was."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

from wive._internal.files import atomic_write

STATE, RECORD = "state.json", "trace.json"
# Of what is written down, and of checksums.
RECORD_FORM = 2
# What an interrupted run must have in common with the one that goes on.
COMMON = {
    "wive": "version of wive",
    "record": "version of wive",
    "accuracy": "accuracy",
    "precision": "precision",
    "mesh": "mesh",
    "query": "query",
    "touching": "touching",
    "rays": "number of rays",
    "kind": "kind of rays",
}


def write_state(folder: str, state: Mapping[str, Any]) -> None:
    """Write down how far a run is."""
    with atomic_write(os.path.join(folder, STATE)) as file:
        file.write(json.dumps(state).encode())


def state_of(folder: str) -> dict[str, Any] | None:
    """What was written down; None if nothing was."""
    try:
        with open(os.path.join(folder, STATE), "rb") as file:
            state = json.load(file)
    except (OSError, ValueError):
        return None
    return state if isinstance(state, dict) else None


def record_of(output: str, is_folder: bool) -> dict[str, Any] | None:
    """The record of a complete output; None if it has none."""
    import zipfile

    try:
        if is_folder:
            with open(os.path.join(output, RECORD), "rb") as file:
                text = file.read()
        else:
            with zipfile.ZipFile(output) as archive:
                text = archive.comment
        record = json.loads(text)
        return record if {"about", "hits", "read"} <= record.keys() else None
    except (AttributeError, OSError, ValueError, zipfile.BadZipFile):
        return None


def expect_common(then: Mapping[str, Any], now: Mapping[str, Any], what: str) -> None:
    """Raise ValueError if a run was of another mesh or other options than those of now."""
    for key, label in COMMON.items():
        if then.get(key) != now[key]:
            seen = "" if key in ("mesh", "record") else f" ({then.get(key)} then, {now[key]} now)"
            raise ValueError(
                f"{what} was of another {label}{seen}: give the same, delete it, or choose another output"
            )
