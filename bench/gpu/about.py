"""Section `about`: the device and the versions, beyond what every bench says of its machine."""

import contextlib
import importlib.metadata
import os

import warp as wp

import wive
from bench.gpu.session import Session
from bench.support.report import Row

LIBRARIES = ("warp-lang", "torch", "cupy-cuda12x", "cupy-cuda13x", "jax")


def run(session: Session) -> Row:
    """One row."""
    row: Row = {"scenes": session.names, "cpus": os.cpu_count()}
    row["backends"] = {name: [backend.usable, backend.reason] for name, backend in wive.backends().items()}
    for library in LIBRARIES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            row[library] = importlib.metadata.version(library)
    device = wp.get_device(session.device)
    row["device"] = device.name
    if session.on_gpu:
        row |= {
            "arch": device.arch,
            "multiprocessors": device.sm_count,
            "memory": device.total_memory,
            "mempool": device.is_mempool_enabled,
            "driver": list(wp.get_cuda_driver_version()),
            "toolkit": list(wp.get_cuda_toolkit_version()),
        }
    return row
