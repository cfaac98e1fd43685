"""One of several meshes moved in place, if nobody else uses the tree: in the time of that mesh's share."""

from __future__ import annotations

import functools
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from wive import _cpu
from wive._internal.cpu_tracer import CpuTracer
from wive._internal.known_meshes import know_again
from wive._internal.precision import Floats

if TYPE_CHECKING:
    from wive.scene import Scene

# Larger meshes take so long that queries of other threads, and Ctrl-C, must not wait for them.
MOST_FACES = 1 << 20


def move_in_place(scene: Scene, i: int, rows: Floats) -> bool:
    """Whether mesh `i` of the scene has its vertices at `rows` now; if not, nothing has changed.

    The tree stays as it is if queries run, or if copies of the scene or arrays of its memory are alive. If
    hits are alive, which show the old positions, the vertices are copied.
    """
    faces = scene.geoms.faces
    if not _counts_references() or faces[i + 1] - faces[i] > MOST_FACES:
        return False
    if not isinstance(scene._tracer, CpuTracer):
        return False
    alike = _unused_scene(scene.precision, scene.backend)
    # Each object is referred to by the scene and by the tuple. No name here holds one meanwhile.
    if not _cpu.is_unused(_held(scene), _held(alike)):  # `move_part` asks again: preparing takes a while
        return False
    scene._tracer.bvh.prepare_part(faces, i)
    starts, computed = scene.geoms.vertices, CpuTracer.COMPUTED
    if not _cpu.move_part(_held(scene), _held(alike), rows, starts, i, computed):
        return False
    know_again(scene.vertices, scene.faces)
    return True


def _held(scene: Scene) -> tuple[CpuTracer, _cpu.Bvh, Floats]:
    """What a scene of a CPU backend holds."""
    return scene._tracer, scene._tracer.bvh, scene._tracer.vertices  # type: ignore[return-value, attr-defined]


@functools.cache
def _unused_scene(precision: str, backend: str) -> Any:
    """A scene that nobody uses: to as few references to its tree, another scene's tree is unused as well."""
    from wive.scene import Scene

    corners = np.eye(3, dtype=precision)
    return Scene.from_meshes([(corners, [[0, 1, 2]])], backend=backend)


def _counts_references() -> bool:
    """Whether this Python counts references exactly, and changes them one thread at a time."""
    is_gil_enabled = getattr(sys, "_is_gil_enabled", None)
    return sys.implementation.name == "cpython" and (is_gil_enabled is None or bool(is_gil_enabled()))
