"""Section `compile`: the kernels of the sections that follow, compiled in parallel into Warp's cache.

A kernel is compiled when it is first launched. Each process launches its share over one ray and a tree of one
triangle that claims the stack size of the real tree.
"""

import dataclasses
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from bench.gpu.forms import (
    FAST_TREES,
    SMALL_FORMS,
    USUAL_FORMS,
    WATERTIGHT,
    Form,
    Options,
    fast_forms,
    right_trees,
)
from bench.gpu.session import Session
from bench.support.report import Row
from wive import _cpu, warp_kernels

QUERIES = ("closest", "any", "count", "all")
SLOWEST = 8  # kernels that the result lists


class Job(NamedTuple):
    """One kernel: its query, its tree, its form, and whether it counts steps."""

    query: str
    options: Options
    stack: int
    form: Form
    counters: bool


def run(session: Session) -> Row:
    """How many kernels there are, and which take longest."""
    if not session.on_gpu:
        return {"left out": "the CPU device compiles each kernel at its first launch"}
    jobs = sorted(set(needed(session)))
    # A process forked from one with a CUDA context can't use CUDA.
    with ProcessPoolExecutor(session.workers, mp_context=get_context("spawn")) as pool:
        seconds = list(pool.map(compiled, jobs, [session.device] * len(jobs)))
    slowest = sorted(zip(seconds, jobs, strict=True), reverse=True)[:SLOWEST]
    return {"kernels": len(jobs), "slowest": [described(*pair) for pair in slowest]}


def needed(session: Session) -> Iterator[Job]:
    """The kernels of sections `right`, `fast`, `small` and `shadow`."""
    for name, options in right_trees(session):
        stack = _stack(session, name, options)
        for form in USUAL_FORMS:
            for query in QUERIES:
                yield Job(query, options, stack, form, counters=query != "all")
    for name in session.names:
        for options in FAST_TREES:
            stack = _stack(session, name, options)
            for form in fast_forms(session, options):
                yield Job("closest", options, stack, form, counters=False)
        stack = _stack(session, name, WATERTIGHT)
        yield Job("any", WATERTIGHT, stack, USUAL_FORMS[1], counters=False)
    for form in SMALL_FORMS:
        yield Job("closest", WATERTIGHT, _stack(session, session.names[0], WATERTIGHT), form, counters=False)


def compiled(job: Job, device: str) -> float:
    """Seconds until the kernel has run over one ray."""
    wp.config.log_level = wp.LOG_WARNING
    launch = launcher(job, device)
    start = time.perf_counter()
    launch()
    wp.synchronize_device(device)
    return time.perf_counter() - start


def launcher(job: Job, device: str) -> Any:
    """A function that launches the kernel over one ray."""
    options = job.options
    vertices = np.eye(3, dtype=options.precision)
    accuracy: Any = options.accuracy
    bvh = _cpu.Bvh(vertices, np.array([[0, 1, 2]], np.int32), accuracy, nodes=options.nodes)  # type: ignore[arg-type]
    tree = dataclasses.replace(warp_kernels.upload(bvh, device), stack=job.stack)
    double = options.precision == "float64"
    vec3, vec2, real = (wp.vec3d, wp.vec2d, wp.float64) if double else (wp.vec3, wp.vec2, wp.float32)

    def array(dtype: Any, count: int = 1) -> Any:
        return wp.zeros(count, dtype=dtype, device=device)

    rays = array(vec3), array(vec3), array(real), array(real)
    given: dict[str, Any] = {"lanes": job.form.lanes, "block_dim": job.form.block}
    if job.counters:
        given["stats"] = array(wp.vec3i)
    hits = array(real), array(wp.int32), array(vec2)
    outputs: dict[str, tuple[Any, ...]] = {
        "closest": hits,
        "any": (array(wp.bool),),
        "count": (array(wp.int32),),
        "all": (array(wp.int32), array(wp.int64, 2), *hits),
    }
    launch = getattr(warp_kernels, f"launch_{job.query}")
    return lambda: launch(tree, *rays, *outputs[job.query], **given)


def described(seconds: float, job: Job) -> Row:
    """A row of the result."""
    row = {"seconds": round(seconds, 1), "query": job.query, **job.options._asdict(), **job.form._asdict()}
    return {**row, "stack": job.stack, "counters": job.counters}


def _stack(session: Session, name: str, options: Options) -> int:
    return int(session.scene(name, *options).tree.stack)
