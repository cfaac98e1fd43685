"""The two precisions of a mesh's vertices, its rays, and t, u, v: float32 and float64.

Boxes are float32 in both (docs/accuracy.md).
"""

from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.lanes import (
    load_double,
    load_float,
    product,
    product_double,
    without_gradient,
)

# words: 32-bit words per number. product: of two numbers, never fused with an addition.
PRECISIONS = {
    "float32": SimpleNamespace(
        name="float32",
        real=wp.float32,
        vec2=wp.vec2,
        vec3=wp.vec3,
        words=1,
        load=load_float,
        product=product,
    ),
    "float64": SimpleNamespace(
        name="float64",
        real=wp.float64,
        vec2=wp.vec2d,
        vec3=wp.vec3d,
        words=2,
        load=load_double,
        product=product_double,
    ),
}


def precision_of(array: wp.array) -> str:
    """The precision of an array of numbers or vectors."""
    return "float64" if array.dtype in (wp.float64, wp.vec2d, wp.vec3d) else "float32"


@wp.func
def in_double(v: wp.vec3) -> wp.vec3d:
    """The vector in double."""
    return wp.vec3d(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]))


@wp.func
def in_double(v: wp.vec3d) -> wp.vec3d:
    return v


def stack_numbers(lanes: SimpleNamespace, precision: str, base: int) -> SimpleNamespace:
    """Numbers kept in the stack from word `base` on: store or load the i-th, or load three at once."""
    store_word, load_word, stack_argument = lanes.store_word, lanes.load_word, lanes.stack_argument
    vec3 = PRECISIONS[precision].vec3

    if precision == "float32":

        @without_gradient
        @wp.func
        def store(stack: stack_argument, i: int, x: float):
            store_word(stack, base + i, wp.cast(x, wp.uint32))

        @without_gradient
        @wp.func
        def load(stack: stack_argument, i: int):
            return wp.cast(load_word(stack, base + i), wp.float32)

    else:

        @without_gradient
        @wp.func
        def store(stack: stack_argument, i: int, x: wp.float64):
            bits = wp.cast(x, wp.uint64)
            store_word(stack, base + 2 * i, wp.uint32(bits & wp.uint64(0xFFFFFFFF)))
            store_word(stack, base + 2 * i + 1, wp.uint32(bits >> wp.uint64(32)))

        @without_gradient
        @wp.func
        def load(stack: stack_argument, i: int):
            high = wp.uint64(load_word(stack, base + 2 * i + 1))
            return wp.cast(wp.uint64(load_word(stack, base + 2 * i)) | (high << wp.uint64(32)), wp.float64)

    @without_gradient
    @wp.func
    def load_vector(stack: stack_argument, first: int):
        return vec3(load(stack, first), load(stack, first + 1), load(stack, first + 2))

    return SimpleNamespace(store=store, load=load, load_vector=load_vector)
