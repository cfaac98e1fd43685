"""The structs that kernels are given and return."""

import sys
from typing import Any

import warp as wp

# The words of a tree's `error`, 0 or 1: its memory was overwritten, and a user's kernel was refused.
CORRUPTION, REFUSAL = 0, 1

ACCURACIES = ("fast", "watertight", "exact")
# The stack of closest_hit, any_hit and count_hits: a tree of 2.7 million triangles needs less than 100.
USERS_STACK = 128


def derive_struct(base: Any, name: str, doc: str, **changed: Any) -> Any:
    """A struct with the fields of `base`; `changed` gives some of them another type."""
    fields = {**base.cls.__annotations__, **changed}
    return wp.struct(
        type(name, (), {"__annotations__": fields, "__doc__": doc, "__module__": base.cls.__module__})
    )


@wp.struct
class Bvh:
    """A watertight float32 tree on a Warp device: made by `upload`, valid while its `Tree` lives."""

    units: wp.array(dtype=wp.float32)  # nodes, then triangle blocks
    error: wp.array(dtype=wp.int32)  # two words, CORRUPTION and REFUSAL
    center: wp.vec3
    extent: wp.vec3  # the largest |coordinate - center| on each axis
    step_limit: wp.int32  # no traversal of a sound tree takes more steps
    stack: wp.int32  # stack size that a traversal may need
    kind: wp.int32  # index into KINDS: a handle of another type has another


FastBvh = derive_struct(Bvh, "FastBvh", "A tree built with accuracy 'fast', otherwise as `Bvh`.")
ExactBvh = derive_struct(Bvh, "ExactBvh", "A tree built with accuracy 'exact', otherwise as `Bvh`.")
Bvh64 = derive_struct(Bvh, "Bvh64", "A tree of float64 vertices, otherwise as `Bvh`.")
FastBvh64 = derive_struct(Bvh, "FastBvh64", "A tree of float64 vertices, otherwise as `FastBvh`.")


@wp.struct
class ListedHit:
    """One of all hits along a ray, as `Hit`."""

    t: wp.float32
    u: wp.float32
    v: wp.float32
    prim: wp.int32


@wp.struct
class ClosestPoint:
    """The closest point of the surface: u and v of `prim`; infinity, NaN and -1 if there is none."""

    distance: wp.float32
    u: wp.float32
    v: wp.float32
    prim: wp.int32


@wp.struct
class Hit:
    """The closest hit: t in multiples of the direction's length; infinity, NaN, NaN and -1 on a miss.

    The point is (1 - u - v) v0 + u v1 + v v2 of triangle `prim`. On a miss the normal is NaN and front false.
    """

    t: wp.float32
    u: wp.float32
    v: wp.float32
    prim: wp.int32
    normal: wp.vec3  # of unit length, by the right-hand winding, whichever side the ray came from
    front: wp.bool  # whether the ray came from the side that the normal points to


_DOUBLE = {"t": wp.float64, "u": wp.float64, "v": wp.float64}
ListedHit64 = derive_struct(ListedHit, "ListedHit64", "A listed hit in a float64 tree.", **_DOUBLE)
Hit64 = derive_struct(Hit, "Hit64", "A hit in a float64 tree, as `Hit`.", **_DOUBLE, normal=wp.vec3d)

# By accuracy and precision: exact trees are float32.
HANDLES: dict[tuple[str, str], Any] = {
    ("fast", "float32"): FastBvh,
    ("watertight", "float32"): Bvh,
    ("exact", "float32"): ExactBvh,
    ("fast", "float64"): FastBvh64,
    ("watertight", "float64"): Bvh64,
}
KINDS = list(HANDLES)
HITS: dict[str, Any] = {"float32": Hit, "float64": Hit64}
LISTED_HITS: dict[str, Any] = {"float32": ListedHit, "float64": ListedHit64}


def _argument(handle: Any) -> Any:
    """The handle as Warp passes it to a kernel; ValueError if the kernel takes a handle of another type.

    Warp 1.19 does not compare types of structs, but asks each for its bytes while `arg_type` is the type of
    the kernel's argument. With a Warp that does otherwise, the kernel refuses the handle.
    """
    packing = sys._getframe(1).f_locals
    wanted: Any = packing.get("arg_type")
    given = handle._cls
    if wanted is given or wanted not in HANDLES.values():
        return handle._ctype
    name, (accuracy, precision) = packing.get("arg_name"), KINDS[list(HANDLES.values()).index(wanted)]
    raise ValueError(
        f"{name} must be a {wanted.key}, got a {given.key}: "
        f"annotate {name} as wive.warp_kernels.{given.key}, "
        f"or make the scene with accuracy={accuracy!r} and {precision} vertices"
    )


for _handle in HANDLES.values():
    _handle.instance_type.__ctype__ = _argument
