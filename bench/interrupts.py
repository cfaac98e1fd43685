"""How long Ctrl-C takes: from SIGINT at a random moment of a call or a command until it has ended.

A call, made again and again in this process, ends when KeyboardInterrupt is caught, a command when its
process is gone. Milliseconds. After each call, 1,000 rays must have the hits of before. No output may be half
written: a file is whole or absent, and of an interrupted `trace`, a run that goes on makes the same hits.
`finished` commands had ended before the signal came. A try in which somebody stopped this process (SIGSTOP)
counts for nothing.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import wive
from bench.contenders.compiled_shim import BenchError
from bench.support import report
from bench.support.options import scene_parser
from bench.support.rays import random_rays
from bench.support.scenes import Mesh, SceneFolder
from bench.support.timing import wall_timed

USUAL = ("city_san_francisco",)
QUICK_SCENES = ("terrain_2k",)
RAYS, QUICK_RAYS = 1_000_000, 50_000
TRIES, QUICK_TRIES = 12, 1
SIDE = 600  # pixels of pictures
COLUMNS = ["scene", "triangles", "where", "kind", "tries", "finished", "median", "p99", "longest"]
CALLS, COMMANDS = "Python", "command line"
Call = Callable[[], object]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells start jobs in the background without it
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, QUICK_SCENES if chosen.quick else USUAL)
    tries = chosen.tries or (QUICK_TRIES if chosen.quick else TRIES)
    random = np.random.default_rng(31)
    rows: list[report.Row] = []
    times: dict[str, list[float]] = {CALLS: [], COMMANDS: []}
    for name in scenes.names:
        mesh = folder.load(name)
        with tempfile.TemporaryDirectory() as place:
            rays = random_rays(mesh, QUICK_RAYS if chosen.quick else RAYS, random)
            np.save(Path(place, "rays.npy"), np.column_stack(rays))
            np.savez(Path(place, "mesh.npz"), vertices=mesh.vertices, faces=mesh.faces)
            for where, found in (
                (CALLS, interrupted_calls(mesh, rays, Path(place), tries, random)),
                (COMMANDS, interrupted_commands(mesh, Path(place), tries, random)),
            ):
                for kind, taken, finished in found:
                    times[where] += taken
                    about = {"scene": name, "triangles": len(mesh.faces), "where": where, "kind": kind}
                    rows.append({**about, "finished": finished, **summary(taken)})
                    report.print_progress(rows[-1], COLUMNS)
    total = [{"where": where, **summary(taken)} for where, taken in times.items()]
    report.print_table(rows, COLUMNS, "Milliseconds until Ctrl-C has ended a call or a command")
    report.print_table(total, ["where", "tries", "median", "p99", "longest"], "All")
    whole = scenes.whole and not chosen.quick and not chosen.tries
    report.save("interrupts", {"rows": rows, "total": total}, chosen.out, whole=whole)


def summary(seconds: Sequence[float]) -> report.Row:
    """Of so many tries, in milliseconds; `p99` is the longest of fewer than a hundred."""
    p99 = float(np.quantile(seconds, 0.99, method="higher"))
    parts = {"median": float(np.median(seconds)), "p99": p99, "longest": max(seconds)}
    return {"tries": len(seconds), **{name: 1e3 * part for name, part in parts.items()}}


Found = Iterator[tuple[str, list[float], int]]  # kind, seconds of each try, how many had finished before


def interrupted_calls(
    mesh: Mesh, rays: tuple[Any, Any], place: Path, tries: int, random: np.random.Generator
) -> Found:
    """Seconds until KeyboardInterrupt, of each kind of call."""
    scene, moving = (wive.Scene(mesh.vertices, mesh.faces) for _ in range(2))
    few = tuple(part[:1000] for part in rays)
    expected = scene.intersect(*few)
    whole = scene.intersect(*rays)
    file, saved, hits = str(place / "rays.npy"), place / "scene.wive", place / "hits.npz"
    scene.save(saved)
    camera = wive.Camera.framing(scene.bounds, None)
    kinds: dict[str, Call] = {
        "Scene": partial(wive.Scene, mesh.vertices, mesh.faces),
        'Scene, quality="high"': partial(wive.Scene, mesh.vertices, mesh.faces, quality="high"),
        "refit": partial(moving.refit, mesh.vertices),
        "intersect": partial(scene.intersect, *rays),
        "occluded": partial(scene.occluded, *rays),
        "count": partial(scene.count, *rays),
        "intersect_all": partial(scene.intersect_all, *rays),
        "closest": partial(scene.closest, rays[0][::5]),
        'contains, sign="winding"': partial(scene.contains, rays[0][::50], sign="winding"),
        "render": partial(wive.render, scene, camera, width=SIDE, height=SIDE),
        "stream": lambda: sum(len(part) for _, part in wive.stream(scene, file)),
        "trace": partial(wive.trace, scene, file, hits),
        "save": partial(scene.save, saved),
    }
    after: dict[str, Call] = {
        "trace": lambda: expect_hits(partial(wive.trace, scene, file, hits, resume=True), hits, whole.prim),
        "save": lambda: expect(wive.load(saved).intersect(*few).prim, expected.prim, "hits of a saved scene"),
    }
    for kind, call in kinds.items():
        taken: list[float] = []
        usual = wall_timed(call)()
        while len(taken) < tries:
            with unless_stopped(taken):
                taken.append(seconds_until_caught(call, random.random() * usual))
            for one in (scene, moving):
                expect(one.intersect(*few).prim, expected.prim, f"hits after {kind}")
            if kind in after:
                after[kind]()
        yield kind, taken, 0
    expect_files(place, {"rays.npy", "mesh.npz", "scene.wive"})


@contextmanager
def unless_stopped(taken: list[float]) -> Iterator[None]:
    """Take back what the block adds if the process is stopped and continued meanwhile."""
    before, stops = len(taken), list[int]()
    usual = signal.signal(signal.SIGCONT, lambda number, _: stops.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGCONT, usual)
        if stops:
            del taken[before:]


def seconds_until_caught(call: Call, wait: float) -> float:
    """From SIGINT, so many seconds after the call's begin, until KeyboardInterrupt is caught."""
    sent: list[float] = []

    def send() -> None:
        time.sleep(wait)
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=send)
    try:
        thread.start()
        while True:
            call()
    except KeyboardInterrupt:
        caught = time.perf_counter()
    thread.join()
    return caught - sent[0]


def interrupted_commands(mesh: Mesh, place: Path, tries: int, random: np.random.Generator) -> Found:
    """Seconds until the process is gone, of each command."""
    wanted = wive.Scene(mesh.vertices, mesh.faces).intersect(*np.hsplit(np.load(place / "rays.npy"), 2)).prim
    picture = f"--width {SIDE} --height {SIDE} --spp 16".split()
    kinds = {
        "wive info": ["info", "mesh.npz"],
        "wive render": ["render", "mesh.npz", "-o", "picture.png", *picture],
        "wive trace": ["trace", "scene.wive", "rays.npy", "-o", "hits.npz"],
        "wive trace --all": ["trace", "scene.wive", "rays.npy", "-o", "hits/", "--all"],
    }
    for kind, arguments in kinds.items():
        command = [sys.executable, "-m", "wive", *arguments]
        run = partial(subprocess.run, cwd=place, check=True, capture_output=True)
        usual = wall_timed(partial(run, command))()
        remove_outputs(place)
        taken: list[float] = []
        finished = 0
        while len(taken) < tries:
            with unless_stopped(taken):
                seconds, code = seconds_until_gone(command, place, random.random() * usual)
                if code == 0:
                    finished += 1
                else:
                    taken.append(seconds)
            expect_no_half_file(kind, place)
            if kind == "wive trace":
                expect_hits(partial(run, [*command, "--resume"]), place / "hits.npz", wanted)
            remove_outputs(place)
        yield kind, taken, finished


def seconds_until_gone(command: Sequence[str], place: Path, wait: float) -> tuple[float, int]:
    """From SIGINT, so many seconds after the begin, until the process is gone; its exit status."""
    with subprocess.Popen(command, cwd=place, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        time.sleep(wait)
        sent = time.perf_counter()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
        taken = time.perf_counter() - sent
    # Until Python has begun to run the command, SIGINT ends it in Python's way.
    if process.returncode not in (0, 130, -signal.SIGINT):
        raise BenchError(f"{' '.join(command)}: exit status {process.returncode}: {errors.decode()[-300:]}")
    return taken, process.returncode


def expect_no_half_file(kind: str, place: Path) -> None:
    """BenchError if an interrupted command has left more than the part of a trace."""
    parts = {"wive trace": {"hits.npz", "hits.npz.part"}, "wive trace --all": {"hits", "hits.part"}}
    expect_files(place, {"rays.npy", "mesh.npz", "scene.wive", *parts.get(kind, {"picture.png"})})
    if (place / "hits.npz").exists():  # whole: the signal came at the very end
        np.load(place / "hits.npz")["prim"]


def expect_hits(call: Call, output: Path, wanted: Any) -> None:
    """BenchError unless the run that goes on makes these hits. Its output is removed."""
    call()
    with np.load(output) as made:
        expect(made["prim"], wanted, f"hits of {output.name}")
    output.unlink()


def expect(found: Any, wanted: Any, what: str) -> None:
    """BenchError unless the arrays are equal."""
    if not np.array_equal(found, wanted):
        raise BenchError(f"{what} are others than without an interruption")


def expect_files(place: Path, wanted: set[str]) -> None:
    """BenchError if there are other files than these."""
    left = {path.name for path in place.iterdir()} - wanted
    if left:
        raise BenchError(f"left after an interruption: {', '.join(sorted(left))}")


def remove_outputs(place: Path) -> None:
    """Removes what the commands have written."""
    for path in [*place.glob("hits*"), *place.glob("picture*")]:
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    parser = scene_parser("interrupts", __doc__)
    parser.add_argument("--tries", type=int, help="of each kind and scene")
    return parser.parse_args(options)
