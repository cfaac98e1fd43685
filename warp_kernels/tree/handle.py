"""What kernels are given and what they return, and the layout they agree on with C++."""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.

from typing import Any

import warp as wp

# layout.h, in words of 32 bits: a child reference without its leaf bit and its block count is the word
# where the child begins, because a unit of 32 bytes is eight words and a reference holds the unit times
# eight.
NODE_WIDTH = 8
NODE_WORDS = 64
BLOCK_WIDTH = 4
BLOCK_WORDS = 40
CHILD_ROW = 48
RANK_ROW = 56  # the order row, inverted by `upload`: lane i holds its own place in each octant's order
PRIM_ROW = 36
# compressed.h, in words: a node, its order lanes of three bytes, its children; the smaller of both blocks
COMPRESSED_NODE_WORDS = 32
COMPRESSED_ORDERS = 18
COMPRESSED_CHILD_ROW = 24
LEAST_COMPRESSED_WORDS = 24
WORD_MASK = 0x7FFFFFF8
END_OF_STACK = -1  # all bits set: a leaf by its sign
NO_PRIM = -1
ALL_BITS = wp.constant(wp.uint32(0xFFFFFFFF))
SIGN_BIT = wp.constant(wp.uint32(0x80000000))

# What a kernel writes to the error flag.
CORRUPT = 1
STACK_TOO_SMALL = 2
WRONG_ACCURACY = 3
COMPRESSED = 4
FLOAT64 = 5

ACCURACIES = ("fast", "watertight", "exact")


@wp.struct
class Bvh:
    """A watertight tree on a Warp device, as kernels see it: made by `upload`, valid while `Tree` lives."""

    units: wp.array(dtype=wp.float32)  # nodes, then triangle blocks
    error: wp.array(dtype=wp.int32)  # one word: 0, or why results can't be trusted
    center: wp.vec3
    extent: wp.vec3
    step_limit: wp.int32  # no traversal of a sound tree takes more steps
    stack: wp.int32  # entries a traversal may need
    accuracy: wp.int32  # its place in ACCURACIES: a handle of another type has another
    refusal: wp.int32  # why closest_hit and its like do not take the tree; 0 where they do


@wp.struct
class FastBvh:
    """The same of a tree built with accuracy "fast"."""

    units: wp.array(dtype=wp.float32)
    error: wp.array(dtype=wp.int32)
    center: wp.vec3
    extent: wp.vec3
    step_limit: wp.int32
    stack: wp.int32
    accuracy: wp.int32
    refusal: wp.int32


@wp.struct
class ExactBvh:
    """The same of a tree built with accuracy "exact"."""

    units: wp.array(dtype=wp.float32)
    error: wp.array(dtype=wp.int32)
    center: wp.vec3
    extent: wp.vec3
    step_limit: wp.int32
    stack: wp.int32
    accuracy: wp.int32
    refusal: wp.int32


@wp.struct
class Hit:
    """The closest hit: t in multiples of the direction's length; infinity, NaN, NaN and -1 on a miss.

    The point is (1 - u - v) v0 + u v1 + v v2 of triangle `prim`.
    """

    t: wp.float32
    u: wp.float32
    v: wp.float32
    prim: wp.int32


@wp.struct
class Hit64:
    """The same of a float64 tree."""

    t: wp.float64
    u: wp.float64
    v: wp.float64
    prim: wp.int32


HANDLES: dict[str, Any] = {"fast": FastBvh, "watertight": Bvh, "exact": ExactBvh}
HITS: dict[str, Any] = {"float32": Hit, "float64": Hit64}
