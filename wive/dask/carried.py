"""How a graph carries a scene: once, as little as its pickle holds, and opened once per process."""

from __future__ import annotations

import multiprocessing
import socket
import sys
import threading
import weakref
from collections import deque
from typing import Any

from dask.base import normalize_token
from dask.delayed import Delayed, delayed
from dask.sizeof import sizeof

from wive._internal.known_meshes import make_known
from wive._internal.stored_scenes import Place
from wive._internal.thread_setting import at_most
from wive.all_hits import AllHits
from wive.hits import Hits
from wive.scene import Scene, expect_scene


class CarriedScene:
    """A scene in a graph.

    Unpickling it neither builds nor maps a tree, because the scheduler does that as well; `scene` does.
    """

    def __init__(self, name: str, scene: Scene | None, parts: tuple[Any, ...] = ()) -> None:
        """Take the scene, or what its `__reduce__` returned."""
        self.name, self._scene, self._parts = name, scene, parts
        if scene is not None:
            _open.setdefault(name, scene)

    @property
    def scene(self) -> Scene:
        """The scene, opened if this process doesn't hold it; errors are those of unpickling it."""
        if self._scene is None:
            self._scene = _opened(self.name, self._parts)
        return self._scene

    @property
    def parts(self) -> tuple[Any, ...]:
        """What the scene's `__reduce__` returns."""
        return self._parts if self._scene is None else self._scene.__reduce__()

    def __reduce__(self) -> tuple[Any, ...]:
        """The name and the parts, whose arrays pickle out of band if the protocol can."""
        return CarriedScene, (self.name, None, self.parts)

    def __dask_tokenize__(self) -> str:
        """The name, which no other tree has."""
        return self.name


# The scenes of this process, by name, while somebody uses them.
_open: weakref.WeakValueDictionary[str, Scene] = weakref.WeakValueDictionary()
# The scene that was opened last stays open between computations.
_kept: deque[Scene] = deque(maxlen=1)
_opening = threading.Lock()


def carried(scene: Scene) -> tuple[CarriedScene, Delayed]:
    """The scene as it is now, whatever refits come, and its one place in a graph."""
    expect_scene(scene)
    found = CarriedScene(name_of(scene), scene._at_rest())
    return found, delayed(found, name=f"wive-scene-{found.name}", pure=True, traverse=False)


def name_of(scene: Scene) -> str:
    """A name that no scene of another tree, backend or device has."""
    source = scene._bvh.source
    token = make_known(scene.vertices, scene.faces, None if source is None else source.place)
    options = scene._options
    own = (scene.accuracy, scene.nodes, options["quality"], options["backend"], options["device"])
    return "-".join(str(part) for part in (token, *own))


def process_threads() -> int | None:
    """How many threads this process may use: as many as its dask worker; None is every core.

    A process of dask's multiprocessing scheduler runs one task at a time beside others.
    """
    if "distributed" in sys.modules:
        from distributed import get_worker

        try:
            return int(get_worker().state.nthreads)
        except ValueError:  # not in a worker
            pass
    return None if multiprocessing.parent_process() is None else 1


def _opened(name: str, parts: tuple[Any, ...]) -> Scene:
    with _opening:  # the others wait for the one that builds
        scene = _open.get(name)
        if scene is None:
            with at_most(process_threads()):
                scene = _open[name] = _unpickled(*parts)
        _kept.append(scene)
        return scene


def _unpickled(function: Any, arguments: tuple[Any, ...], state: Any = None) -> Scene:
    try:
        scene: Scene = function(*arguments)
        scene._bvh.verify()
    except (OSError, ValueError) as error:
        line = f"worker on {socket.gethostname()}: {error}"
        if isinstance(arguments[0], Place) and arguments[0].kind == "shared memory":
            line += "; workers on other machines need a scene saved to a file that they see, and loaded"
        raise (type(error) if isinstance(error, OSError) else ValueError)(line) from error
    if state is not None:
        scene.__setstate__(state)
    return scene


@normalize_token.register(Scene)
def _token_of_scene(scene: Scene) -> str:
    return name_of(scene)


@sizeof.register(CarriedScene)
def _size_of_carried(held: CarriedScene) -> int:
    """Bytes of its pickle, which is what sending it to a worker costs."""
    return sum(getattr(argument, "nbytes", 100) for argument in held.parts[1])


@sizeof.register(Hits)
@sizeof.register(AllHits)
def _size_of_hits(hits: Hits | AllHits) -> int:
    """Bytes of the arrays, without the mesh."""
    rays = getattr(hits, "_rays", None) or ()
    return sum(getattr(array, "nbytes", 0) for array in (hits.t, hits.prim, hits.uv, *rays[:4]))
