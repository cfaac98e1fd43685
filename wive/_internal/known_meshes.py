"""The meshes that this process holds, by tokens: pickled hits name theirs instead of holding it."""

from __future__ import annotations

import os
import weakref
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from wive._internal.precision import Floats
from wive._internal.process_lock import PROCESS_LOCK
from wive._internal.read_only import ReadOnly
from wive._internal.stored_scenes import Place, source_of

MESH = ("vertices", "faces")


class MeshName(NamedTuple):
    """What stands for a mesh in a pickle."""

    token: str
    place: Place | None  # where its tree is stored
    vertices: int
    faces: int
    dtype: str


class Known(NamedTuple):
    """A mesh and its name. The references are weak: hits keep a mesh, this doesn't."""

    name: MeshName
    vertices: weakref.ref[Any]
    faces: weakref.ref[Any]


# By the address of the vertices, which are one object per tree. Several may have one token: a scene and those
# that were unpickled from it.
_known: dict[int, Known] = {}


def make_known(vertices: Floats, faces: NDArray[np.int32], place: Place | None, token: str = "") -> str:
    """Give the mesh of a new scene its token, which processes forked later share; or the one it had."""
    key = id(vertices)

    def forget(reference: object) -> None:
        with PROCESS_LOCK:
            if key in _known and _known[key].vertices is reference:
                del _known[key]

    with PROCESS_LOCK:
        name = _name_of_known(vertices)
        if name is None:
            token = place.digest if place else token or os.urandom(12).hex()
            name = MeshName(token, place, len(vertices), len(faces), vertices.dtype.name)
            _known[key] = Known(name, weakref.ref(vertices, forget), weakref.ref(faces))
        return name.token


def know_again(vertices: Floats, faces: NDArray[np.int32], token: str = "") -> None:
    """Give a mesh another token in place of the one it has.

    The one that it was pickled with; or a new one if it has moved in place, so that hits pickled before don't
    find it.
    """
    with PROCESS_LOCK:
        _known.pop(id(vertices), None)
        make_known(vertices, faces, None, token)


def mesh_of(name: MeshName) -> tuple[Floats, NDArray[np.int32]] | None:
    """The mesh of that name, if this process holds it, or it is stored.

    OSError or ValueError if it is stored and no longer there.
    """
    with PROCESS_LOCK:
        alike = [known for known in _known.values() if known.name.token == name.token]
    for known in alike:
        vertices, faces = known.vertices(), known.faces()
        if vertices is not None and faces is not None:
            return vertices, faces
    if name.place is None:
        return None
    bvh = name.place.open()
    bvh.verify()
    source = source_of(bvh)
    make_known(source.vertices, source.faces, source.place)
    return source.vertices, source.faces


def _name_of_known(vertices: Any) -> MeshName | None:
    known = _known.get(id(vertices))
    return None if known is None or known.vertices() is not vertices else known.name


OfMeshT = TypeVar("OfMeshT", bound="OfMesh")


class OfMesh(ReadOnly):
    """Hits: pickled without the mesh, which is looked up when it is used."""

    vertices: Floats
    faces: NDArray[np.int32]

    def with_mesh(self: OfMeshT, scene: Any) -> OfMeshT:
        """The same hits, with the mesh of `scene`, which is the one that they were found in or its copy.

        For hits that were unpickled in a process that doesn't hold their mesh. Raises ValueError if the scene
        has another number of vertices or triangles.
        """
        name = vars(self).get("_mesh") or _name_of(self)
        found = len(scene.vertices), len(scene.faces), scene.vertices.dtype.name
        if found != name[2:]:
            raise ValueError(
                f"scene must be the one that was hit, of {name.vertices} {name.dtype} vertices and "
                f"{name.faces} triangles, got one of {found[0]} {found[2]} vertices and {found[1]} triangles"
            )
        copy = object.__new__(type(self))
        state = {**vars(self), "vertices": scene.vertices, "faces": scene.faces}
        state.pop("_mesh", None)
        if isinstance(state.get("_home"), OfMesh):
            state["_home"] = state["_home"].with_mesh(scene)
        vars(copy).update(state)
        return copy

    def __getattr__(self, name: str) -> Any:
        """Look the mesh up that unpickled hits name; called for attributes that are not there."""
        mesh_name = vars(self).get("_mesh")
        if name not in MESH or mesh_name is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        found = mesh_of(mesh_name)
        if found is None:
            raise ValueError(
                f"{name} of these hits, which pickles don't hold, are not in this process: use "
                "hits.with_mesh(scene), or share or save the scene before you query it"
            )
        vars(self).update(zip(MESH, found, strict=True))
        return vars(self)[name]

    def __getstate__(self) -> dict[str, Any]:
        """All but the mesh, if that is a scene's."""
        state = dict(vars(self))
        if "vertices" in state:
            name = _name_of_known(state["vertices"])
            if name is None:  # made by hand
                return state
            state["_mesh"] = name
        for key in MESH:
            state.pop(key, None)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what was pickled."""
        vars(self).update(state)

    def __copy__(self: OfMeshT) -> OfMeshT:
        """A copy that shares all arrays."""
        copy = object.__new__(type(self))
        vars(copy).update(vars(self))
        return copy

    def __deepcopy__(self: OfMeshT, memo: dict[int, Any]) -> OfMeshT:
        """A copy of all arrays, and of the mesh."""
        from copy import deepcopy

        copy = object.__new__(type(self))
        memo[id(self)] = copy
        vars(copy).update({name: deepcopy(value, memo) for name, value in dict(vars(self)).items()})
        return copy


def mesh_attributes(hits: Any) -> dict[str, Any]:
    """The mesh of other hits, or its name, as attributes of hits that wrap them."""
    name = vars(hits).get("_mesh")
    if name is not None and "vertices" not in vars(hits):
        return {"_mesh": name}
    return {"vertices": hits.vertices, "faces": hits.faces}


def mesh_sizes(hits: Any) -> tuple[int, int]:
    """The number of triangles and of vertices, without looking the mesh up."""
    name = vars(hits).get("_mesh")
    return (len(hits.faces), len(hits.vertices)) if name is None else (name.faces, name.vertices)


def _name_of(hits: OfMesh) -> MeshName:
    return MeshName("", None, len(hits.vertices), len(hits.faces), hits.vertices.dtype.name)
