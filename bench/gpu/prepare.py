"""Packs Warp and scenes for a GPU machine without a package index: `python -m bench gpu-prepare FOLDER`.

The machine takes a copy of the repository and a limited number of bytes at a time. Warp's wheel loses what a
GPU run doesn't need, its CPU compiler, examples and tests, and is cut into pieces; bench/gpu/steps.sh builds
wive there while the pieces arrive. Prints the steps.
"""

import argparse
import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench.contenders.compiled_shim import BenchError
from bench.gpu.session import SCENES
from bench.support.report import REPOSITORY
from bench.support.scenes import SceneFolder

LARGEST_PIECE = 60_000_000  # bytes
UNNEEDED = ("warp/bin/warp-clang.so", "warp/examples/", "warp/tests/")
PLATFORM = "manylinux_2_28_x86_64"


def main(options: Sequence[str]) -> None:
    """Fills the folder and prints what to copy and run."""
    parser = argparse.ArgumentParser(prog="python -m bench gpu-prepare", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder inside the repository; git will ignore it")
    parser.add_argument("--warp", type=Path, help="Warp's wheel; by default pip downloads it")
    parser.add_argument("--python", default="3.12", help="the machine's Python, for the download")
    parser.add_argument("--scene-dir", type=Path, help="folder of scenes (docs/scenes.md)")
    chosen = parser.parse_args(options)
    folder = chosen.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / ".gitignore").write_text("*\n")
    with tempfile.TemporaryDirectory() as scratch:
        wheel = chosen.warp or downloaded_warp(chosen.python, Path(scratch))
        pieces = cut(trimmed(wheel, Path(scratch)), folder)
    copy_scenes(SceneFolder(chosen.scene_dir), folder / "scenes")
    inside = folder.is_relative_to(REPOSITORY)
    print(steps(Path(os.path.relpath(folder, REPOSITORY)) if inside else folder, pieces))


def downloaded_warp(python: str, folder: Path) -> Path:
    """The wheel of the Warp version that is installed here."""
    version = importlib.metadata.version("warp-lang")
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:"]
    command += ["--python-version", python, "--platform", PLATFORM, "--dest", str(folder)]
    answer = subprocess.run([*command, f"warp-lang=={version}"], capture_output=True, text=True, check=False)
    wheels = list(folder.glob("warp_lang-*.whl"))
    if answer.returncode or not wheels:
        raise BenchError(f"pip can't download Warp {version}: {answer.stderr.strip()}")
    return wheels[0]


def trimmed(wheel: Path, folder: Path) -> Path:
    """A zip of the wheel's files without those that a GPU run doesn't need."""
    path = folder / "warp.zip"
    with (
        zipfile.ZipFile(wheel) as source,
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as target,
    ):
        for item in source.infolist():
            if not item.filename.startswith(UNNEEDED):
                target.writestr(item.filename, source.read(item))
    return path


def cut(path: Path, folder: Path) -> list[str]:
    """Cuts the file into pieces warp.1-of-3, ...; returns their names."""
    for old in folder.glob("warp.*-of-*"):
        old.unlink()
    data = path.read_bytes()
    count = -(-len(data) // LARGEST_PIECE)
    size = -(-len(data) // count)
    names = [f"warp.{number}-of-{count}" for number in range(1, count + 1)]
    for number, name in enumerate(names):
        (folder / name).write_bytes(data[number * size : (number + 1) * size])
    return names


def copy_scenes(source: SceneFolder, folder: Path) -> None:
    """Writes the scenes of the bench, those that are here, and their cameras."""
    names = source.select((), SCENES).names
    if any(folder in path.resolve().parents for path in source.files()):
        raise BenchError(f"{folder} holds the scenes to copy, which would be lost: choose another folder")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    cameras = {}
    for name in names:
        mesh = source.load(name)
        np.savez_compressed(folder / f"{name}.npz", vertices=mesh.vertices, faces=mesh.faces)
        cameras[name] = {key: getattr(mesh.camera, key) for key in ("eye", "target", "up", "fov")}
    (folder / "cameras.json").write_text(json.dumps(cameras))


def steps(folder: Path, pieces: Sequence[str]) -> str:
    """What to copy and what to run, one step per piece; a single piece takes two steps."""
    first, *further = pieces
    lines = [f"1. copy the repository and {folder / first}, then: sh bench/gpu/steps.sh start {folder}"]
    for piece in further[:-1]:
        lines.append(f"{len(lines) + 1}. copy {folder / piece}, then: sh bench/gpu/steps.sh piece {folder}")
    last = f"{folder / further[-1]} and " if further else ""
    run = f"sh bench/gpu/steps.sh run {folder} --out OUT --budget 400"
    lines.append(f"{len(lines) + 1}. copy {last}{folder / 'scenes'}, then: {run}")
    lines.append(f"once more, while the machine is there: {run} --only about,SECTION")
    return "\n".join(lines)
