"""The structs that kernels are given and return."""

from typing import Any

import warp as wp

# Why a kernel could not traverse a tree, as written to its error flag.
CORRUPT = 1
STACK_TOO_SMALL = 2
WRONG_ACCURACY = 3
COMPRESSED = 4
FLOAT64 = 5

ACCURACIES = ("fast", "watertight", "exact")


def derive_struct(base: Any, name: str, doc: str, **changed: Any) -> Any:
    """A struct with the fields of `base`; `changed` gives some of them another type."""
    fields = {**base.cls.__annotations__, **changed}
    return wp.struct(
        type(name, (), {"__annotations__": fields, "__doc__": doc, "__module__": base.cls.__module__})
    )


@wp.struct
class Bvh:
    """A watertight tree on a Warp device: made by `upload`, valid while its `Tree` lives."""

    units: wp.array(dtype=wp.float32)  # nodes, then triangle blocks
    error: wp.array(dtype=wp.int32)  # one word: 0, or why results can't be trusted
    center: wp.vec3
    step_limit: wp.int32  # no traversal of a sound tree takes more steps
    stack: wp.int32  # stack size that a traversal may need
    accuracy: wp.int32  # index into ACCURACIES: a handle of another type has another
    refusal: wp.int32  # why closest_hit, any_hit and count_hits refuse the tree; 0 if they take it


FastBvh = derive_struct(Bvh, "FastBvh", "A tree built with accuracy 'fast', otherwise as `Bvh`.")
ExactBvh = derive_struct(Bvh, "ExactBvh", "A tree built with accuracy 'exact', otherwise as `Bvh`.")


@wp.struct
class Hit:
    """The closest hit: t in multiples of the direction's length; infinity, NaN, NaN and -1 on a miss.

    The point is (1 - u - v) v0 + u v1 + v v2 of triangle `prim`.
    """

    t: wp.float32
    u: wp.float32
    v: wp.float32
    prim: wp.int32


Hit64 = derive_struct(Hit, "Hit64", "A hit in a float64 tree.", t=wp.float64, u=wp.float64, v=wp.float64)

HANDLES: dict[str, Any] = {"fast": FastBvh, "watertight": Bvh, "exact": ExactBvh}
HITS: dict[str, Any] = {"float32": Hit, "float64": Hit64}
