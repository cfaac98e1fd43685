"""wive.dask on threads and on two processes over one call of the scene, on as many cores.

20 million incoherent rays, origins uniform in the scene's box, lie ready in memory before the time is taken:
of the process, or of the workers, which keep the hits. `speed`: seconds of one call of `Scene.intersect` on
two threads over those of dask, in turn. Chunks have five million rays. Workers map a saved scene. `task_ms`
is what dask takes per task on two processes, from chunks of one ray.
"""

import argparse
import itertools
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import wive
from bench.support import report
from bench.support.options import scene_parser
from bench.support.scenes import TERRAIN, SceneFolder
from bench.support.timing import QUICK, Effort, compare_in_turn, wall_timed

CORES = 2
RAYS, CHUNK = 20_000_000, 5_000_000
QUICK_RAYS, QUICK_CHUNK = 20_000, 2_000
TASKS, QUICK_TASKS = 2_000, 50
EFFORT = Effort(least=9, most=9)
FAR = 1e30  # tmax, another one per run: dask keeps what it has computed
CALL, THREADS, PROCESSES = "Scene.intersect", "wive.dask, threads", "wive.dask, processes"
COLUMNS = ["scene", "triangles", "contender", "count", "speed", "low", "high", "mrays", "rounds"]


def main(options: Sequence[str]) -> None:
    """Runs the bench with command-line options."""
    chosen = parse_options(options)
    folder = SceneFolder(chosen.scene_dir)
    scenes = folder.select(chosen.scenes, (TERRAIN,))
    count, chunk = (QUICK_RAYS, QUICK_CHUNK) if chosen.quick else (RAYS, CHUNK)
    rows: list[report.Row] = []
    task_ms = making_ns = 0.0
    for name in scenes.names:
        mesh = folder.load(name)
        with tempfile.TemporaryDirectory() as place:
            wive.Scene(mesh.vertices, mesh.faces).save(Path(place) / "scene")
            scene = wive.load(Path(place) / "scene")
            with contenders(scene, count, chunk, place) as (runs, seconds_of_tasks):
                outcomes = compare_in_turn(
                    [wall_timed(run) for run in runs.values()], QUICK if chosen.quick else EFFORT
                )
                tasks = QUICK_TASKS if chosen.quick else TASKS
                task_ms = seconds_of_tasks(tasks) / tasks * 1e3
            making_ns = making_seconds(scene, chunk) / chunk * 1e9
            del scene
        for contender, outcome in zip(runs, outcomes, strict=True):
            rows.append(
                {
                    "scene": name,
                    "triangles": len(mesh.faces),
                    "contender": contender,
                    "count": count,
                    "speed": outcome.ratio,
                    "low": outcome.low,
                    "high": outcome.high,
                    "mrays": count / outcome.our_seconds * 1e-6,
                    "rounds": outcome.rounds,
                }
            )
    report.print_table(rows, COLUMNS, f"Speed over one call of the scene on {CORES} threads")
    print(
        f"\ndask takes {task_ms:.2f} ms per task on {CORES} processes, NumPy {making_ns:.0f} ns to make a ray"
    )
    whole = scenes.whole and not chosen.quick
    content = {"task_ms": task_ms, "making_ns": making_ns, "rows": rows}
    report.save("dask", content, chosen.out, whole=whole)


@contextmanager
def contenders(
    scene: wive.Scene, count: int, chunk: int, place: str
) -> Iterator[tuple[dict[str, Callable[[], object]], Callable[[int], float]]]:
    """Each way to trace the same rays, warmed up; and the seconds of so many tasks on two processes."""
    import dask.array as da
    from dask.base import compute
    from distributed import Client, LocalCluster, wait

    import wive.dask

    low, high = scene.bounds
    form = {"dtype": np.float32, "meta": np.empty((0, 0, 3), np.float32)}
    # One array, so that a worker has both the origins and the directions of a chunk.
    made = da.map_blocks(random_rays, low, high, chunks=((2,), (chunk,) * (count // chunk), (3,)), **form)
    arrays = compute(made[0], made[1], scheduler="threads")
    in_process = [da.from_array(array, chunks=(chunk, 3), name=False) for array in arrays]
    far = itertools.count(1)
    with (
        LocalCluster(
            n_workers=CORES, threads_per_worker=1, dashboard_address=None, local_directory=place
        ) as cluster,
        Client(cluster) as client,
    ):
        addresses = list(client.scheduler_info(n_workers=-1)["workers"])
        share = count // chunk // len(addresses) * chunk  # of rays, for each worker
        parts = [
            client.persist([made[kind, i * share : (i + 1) * share] for kind in (0, 1)], workers=[address])
            for i, address in enumerate(addresses)
        ]
        wait(parts)
        in_workers = [da.concatenate(halves) for halves in zip(*parts, strict=True)]

        def on_processes() -> object:
            hits = wive.dask.intersect(scene, in_workers[0], in_workers[1], tmax=FAR * next(far))
            return wait(client.persist(hits))

        def on_threads() -> object:
            hits = wive.dask.intersect(scene, in_process[0], in_process[1], tmax=FAR * next(far))
            return hits.persist(scheduler="threads", num_workers=CORES)

        def seconds_of_tasks(tasks: int) -> float:
            rays = da.zeros((tasks, 3), chunks=(1, 3))
            start = time.perf_counter()
            wait(client.persist(wive.dask.occluded(scene, rays, (0.0, 0.0, 1.0))))
            return time.perf_counter() - start

        runs: dict[str, Callable[[], object]] = {
            CALL: lambda: scene.intersect(*arrays, threads=CORES),
            THREADS: on_threads,
            PROCESSES: on_processes,
        }
        for run in runs.values():
            run()
        yield runs, seconds_of_tasks


def making_seconds(scene: wive.Scene, chunk: int) -> float:
    """Seconds to make the rays of a chunk."""
    about = {None: {"chunk-location": (0, 0, 0), "chunk-shape": (2, chunk, 3)}}
    start = time.perf_counter()
    low, high = scene.bounds
    random_rays(low, high, about)
    return time.perf_counter() - start


def random_rays(
    low: NDArray[np.float32],
    high: NDArray[np.float32],
    block_info: Mapping[None, report.Row] | None = None,
) -> NDArray[np.float32]:
    """(2,n,3) origins and directions of a chunk, of a seed of their own."""
    assert block_info is not None
    about = block_info[None]
    shape: tuple[int, int, int] = about["chunk-shape"]
    random = np.random.default_rng(about["chunk-location"][1])
    origins = low + (high - low) * random.random(shape[1:], np.float32)
    return np.stack([np.asarray(origins, np.float32), random.standard_normal(shape[1:], np.float32)])


def parse_options(options: Sequence[str]) -> argparse.Namespace:
    """The command line's choices."""
    return scene_parser("dask", __doc__).parse_args(options)
