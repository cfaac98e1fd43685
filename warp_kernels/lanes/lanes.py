"""The two lane forms: vectors and collectives for the eight lanes of a node.

The lane form says how the eight lanes of a node are spread over threads, and is named by its vector length:

- lanes=8: one thread per ray owns all eight lanes as vectors of length eight, and its stack is a local array.
- lanes=1: eight threads per ray, a group, own one lane each. On CUDA they communicate by warp intrinsics and
  share a stack in shared memory. On Warp's CPU device they are fibers of a block, which run one at a time and
  switch at barriers (warps.py).

Code outside this folder is written once for both forms.
"""

import functools
from types import SimpleNamespace

import warp as wp

from wive.warp_kernels.lanes.layout import CORNER_WORDS
from wive.warp_kernels.lanes.native import (
    BYTE_OF,
    DISTANCES_1,
    DISTANCES_8,
    DOUBLE_TRIANGLES_4,
    LARGER,
    PRODUCT,
    PRODUCTS,
    ROUNDED_AS_WRITTEN,
    ROW_1,
    ROW_8,
    STACK_1,
    STACK_8,
    TRIANGLES_4,
    shared_stack_code,
)
from wive.warp_kernels.lanes.vectors import vector_code
from wive.warp_kernels.lanes.warps import collectives, expected_lanes


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __ffs(mask) - 1;
#else
    return __builtin_ctz(mask);
#endif
""")
def lowest_lane(mask: wp.uint32) -> int:
    """The lowest bit set in a mask, which must not be zero."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __ldg((const float*)units + at);
#else
    return ((const float*)units)[at];
#endif
""")
def load_float(units: wp.uint64, at: int) -> float:
    """One word of the tree, bits unchanged."""
    ...


@wp.func_native("""
    const double* number = (const double*)((const float*)units + at);
#if defined(__CUDA_ARCH__)
    return __ldg(number);
#else
    return *number;
#endif
""")
def load_double(units: wp.uint64, at: int) -> wp.float64:
    """The number stored in two words of the tree."""
    ...


@wp.func_native(BYTE_OF)
def byte_of(word: wp.uint32, i: int) -> int:
    """The word's i-th byte from below."""
    ...


@wp.func_native(PRODUCT.replace("ROUNDED", "__fmul_rn"))
def product(a: float, b: float) -> float:
    """a b, rounded: never fused with an addition."""
    ...


@wp.func_native(PRODUCT.replace("ROUNDED", "__dmul_rn"))
def product_double(a: wp.float64, b: wp.float64) -> wp.float64:
    """a b, rounded: never fused with an addition."""
    ...


@wp.func_native(LARGER)
def larger(a: float, b: float) -> float:
    """The larger of two numbers; of NaN and a number, either."""
    ...


@wp.func_native(LARGER)
def larger(a: wp.float64, b: wp.float64) -> wp.float64: ...


@wp.func_native("return (wp::uint64)units.data;")
def address_of(units: wp.array(dtype=wp.float32)) -> wp.uint64:
    """Address of the tree: one register to pass on instead of an array's dozen."""
    ...


@wp.func_native(ROUNDED_AS_WRITTEN)
def rounded_as_written():
    """Nothing: it compiles only if every operation is rounded as it is written."""
    ...


def without_gradient(function: wp.Function) -> wp.Function:
    """Keep Warp from building the function's adjoint, which functions with reference arguments can't have."""
    function.is_differentiable = False
    function.adj.skip_reverse_codegen = True
    return function


@functools.cache
def lanes_of(length: int, stack_words: int, precision: str) -> SimpleNamespace:
    """Vectors, loads, collectives and the stack of a lane form.

    length: lanes of a node per thread, 8 or 1. Vectors over a block's triangles have half as many lanes, at
    least one, and numbers of `precision`. stack_words: words that the stack has room for.
    """
    eight = expected_lanes(length) == 8
    triangles_length = 4 if eight else 1
    rounded = "__fmul_rn" if precision == "float32" else "__dmul_rn"
    vector = wp.types.vector(length=length, dtype=wp.float32)
    words = wp.types.vector(length=length, dtype=wp.uint32)
    triangles = wp.types.vector(length=triangles_length, dtype=getattr(wp, precision))
    # In 64 bits, which aligns the stack: words that are neighbours are then loaded together on CUDA.
    stack_type = wp.types.vector(length=-(-stack_words // 2), dtype=wp.uint64)
    stack_words_code = STACK_8 if eight else STACK_1
    stack_argument = wp.ref[stack_type] if eight else wp.uint64

    @wp.func_native(vector_code(DISTANCES_8, vector) if eight else DISTANCES_1)
    def plane_distances(
        units: wp.uint64, node: int, lane: int, row: int, rdir: float, bias: float
    ) -> vector: ...

    @wp.func_native(ROW_8 if eight else ROW_1)
    def load_row(units: wp.uint64, node: int, word: int, lane: int) -> words: ...

    if eight:

        @wp.func_native(vector_code(TRIANGLES_4 if precision == "float32" else DOUBLE_TRIANGLES_4, triangles))
        def load_triangles(row: wp.uint64, k: int) -> triangles: ...
    else:
        # Native code here makes NVRTC peel the loop over a leaf's blocks: six registers more on sm_100.
        load_number = load_float if precision == "float32" else load_double
        corner_words: int = CORNER_WORDS * (1 if precision == "float32" else 2)

        @wp.func
        def load_triangles(row: wp.uint64, k: int):
            return triangles(load_number(row, corner_words * k))

    @wp.func_native(vector_code(PRODUCTS.replace("ROUNDED", rounded), triangles))
    def products(a: triangles, b: triangles) -> triangles: ...

    @wp.func_native(shared_stack_code(stack_words))
    def shared_stack() -> wp.uint64: ...

    @wp.func_native(f"{stack_words_code}    words[at] = word;")
    def store_word(stack: stack_argument, at: int, word: wp.uint32): ...

    @wp.func_native(f"{stack_words_code}    return words[at];")
    def load_word(stack: stack_argument, at: int) -> wp.uint32: ...

    return SimpleNamespace(
        length=length,
        block_step=1 if eight else 2,  # blocks of a leaf that a ray's threads test at once
        vector=vector,
        words=words,
        triangles=triangles,
        triangles_length=triangles_length,
        plane_distances=plane_distances,
        load_row=load_row,
        load_triangles=load_triangles,
        products=products,
        new_stack=stack_type if eight else shared_stack,
        stack_argument=stack_argument,
        store_word=without_gradient(store_word),
        load_word=without_gradient(load_word),
        **vars(collectives(length)),
    )
