"""The closest point of the surface, one thread per point, as cpu/traverse/closest_point.h."""

import functools
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.lanes import address_of, lanes_of, load_float, without_gradient
from wive.warp_kernels.lanes.layout import (
    ALL_BITS,
    BLOCK_WIDTH,
    END_OF_STACK,
    NO_PRIM,
    NODE_WIDTH,
    WORD_MASK,
)
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.queries.frame import LEAST_MAGNITUDE, MAX_COORDINATE, SLACK_FACTOR, SUBNORMAL_STEP
from wive.warp_kernels.tree.blocks import block_form
from wive.warp_kernels.tree.handle import CORRUPTION, HANDLES
from wive.warp_kernels.tree.nodes import NODES
from wive.warp_kernels.triangles.distance import closest_weights, squared_distance

MOST = wp.constant(wp.float64(2.0**16))
ROUNDING = wp.constant(wp.float64(2.0**-44))
TWICE_ONE = wp.constant(wp.uint32(254))  # exponent fields of a number and of its scale add up to this
MANTISSA = wp.constant(wp.uint32(23))
# Factors by which a limit is larger than what is compared once rounded, and boxes' limits than that.
MARGIN = {"float32": 1 + 4 * 2.0**-23, "float64": 1 + 4 * 2.0**-52}
LEAST = {"float32": 2.0**-149, "float64": 2.0**-1074}
BOX_MARGIN = wp.constant(wp.float64(2.0**-22))


@wp.struct
class Nearest:
    """The triangle at the least squared distance so far; prim -1 if none is near enough."""

    squared: wp.float64
    prim: wp.int32
    block: wp.int32  # and where it is: a word of the tree, a lane there
    lane: wp.int32


@wp.struct
class Located:
    """The closest point: u and v of triangle `prim`; infinity, NaN and -1 if no triangle is near enough."""

    distance: wp.float64
    u: wp.float64
    v: wp.float64
    prim: wp.int32


@wp.struct
class PointFrame:
    """A point made ready for tests of boxes; cpu/traverse/point_boxes.h explains and derives bounds."""

    low_bias: wp.vec3
    high_bias: wp.vec3
    beyond: wp.vec3
    scale: wp.float32
    beyond_squared: wp.float64


@wp.func
def _frame(relative: wp.vec3d, extent: wp.vec3) -> PointFrame:
    frame = PointFrame()
    nearest = wp.vec3()
    away = wp.vec3d()
    magnitude = float(0.0)
    for axis in range(3):
        reach = wp.float64(extent[axis])
        nearest[axis] = wp.float32(wp.clamp(relative[axis], -reach, reach))
        away[axis] = wp.max(wp.abs(relative[axis]) - reach, wp.float64(0.0))
        magnitude = wp.max(magnitude, extent[axis] + wp.float32(away[axis]))
    size = wp.max(wp.abs(nearest))
    magnitude = magnitude + size + LEAST_MAGNITUDE
    frame.scale = wp.cast((TWICE_ONE - (wp.cast(magnitude, wp.uint32) >> MANTISSA)) << MANTISSA, wp.float32)
    frame.beyond_squared = wp.dot(away, away)
    slack = size * frame.scale * SLACK_FACTOR
    for axis in range(3):
        frame.low_bias[axis] = -(nearest[axis] * frame.scale + slack)
        frame.high_bias[axis] = nearest[axis] * frame.scale - slack
        frame.beyond[axis] = wp.float32(away[axis] * wp.float64(frame.scale))
    return frame


@wp.func
def _box_limit(frame: PointFrame, squared: wp.float64) -> float:
    scale = wp.float64(frame.scale)
    rest = squared * (wp.float64(1.0) + ROUNDING) - frame.beyond_squared * (wp.float64(1.0) - ROUNDING)
    scaled = rest * scale * scale
    if scaled < MOST:
        return wp.float32(scaled + wp.abs(scaled) * BOX_MARGIN) + SUBNORMAL_STEP
    return wp.float32(MOST)


@functools.cache
def make_closest_point(accuracy: str, stack_size: int, nodes: str, precision: str) -> wp.Function:
    """The search for an accuracy, stack size, node form and precision: search(tree, point, most)."""
    lanes = lanes_of(8, 2 * stack_size, precision)
    blocks, node = block_form(lanes, nodes, precision), NODES[nodes](lanes)
    numbers, tree_type = PRECISIONS[precision], HANDLES[accuracy, precision]
    real, vec3, load_number = numbers.real, numbers.vec3, numbers.load
    of_edges: bool = accuracy == "fast"
    node_words: int = node.words
    block_words: int = blocks.least_words
    child_row: int = node.child_row
    grid_of, distances, low_row, used = node.grid, node.distances, node.low_row, node.used
    load_row, store_word, load_word = lanes.load_row, lanes.store_word, lanes.load_word
    vector: Any = lanes.vector
    new_stack, stack_argument = lanes.new_stack, lanes.stack_argument
    vertex_at, stride, edge_of, prim_at, block_at = (
        blocks.vertex_at, blocks.stride, blocks.edge_of, blocks.prim_at, blocks.block_at
    )  # fmt: skip
    largest: Any = real(MAX_COORDINATE)
    margin, least = wp.float64(MARGIN[precision]), wp.float64(LEAST[precision])

    @without_gradient
    @wp.func
    def corners_of(units: wp.uint64, block: int, j: int) -> wp.mat33d:
        corners = wp.mat33d()
        step = stride(units, block)
        for k in range(3):
            at = vertex_at(units, block, k, j)
            first = vertex_at(units, block, 0, j)
            for axis in range(3):
                if wp.static(of_edges):
                    v0 = load_number(units, first + axis * step)
                    corners[k, axis] = wp.float64(v0)
                    if k > 0:
                        corners[k, axis] = wp.float64(v0) + wp.float64(
                            edge_of(load_number(units, at + axis * step), v0)
                        )
                else:
                    corners[k, axis] = wp.float64(load_number(units, at + axis * step))
        return corners

    @without_gradient
    @wp.func
    def visit(
        units: wp.uint64, begin: int, frame: PointFrame, limit: float, stack: stack_argument, top: int
    ) -> int:
        """Store at `top` the children that are near enough, the nearest last; return their number."""
        children = load_row(units, begin, child_row, 0)
        grid = grid_of(units, begin)
        slots = used(grid)
        squared = vector(0.0)
        for axis in range(3):
            row, low_bias, high_bias = low_row(axis), frame.low_bias[axis], frame.high_bias[axis]
            low, high = distances(
                units, begin, grid, 0, axis, row, frame.scale, -frame.scale, low_bias, high_bias
            )
            for i in range(8):
                gap = wp.max(wp.max(low[i], high[i]), -frame.beyond[axis])
                squared[i] = squared[i] + gap * (gap + 2.0 * frame.beyond[axis])
        count = int(0)
        nearest = int(0)
        least_squared = float(wp.inf)
        for i in range(8):
            if squared[i] <= limit and (slots >> wp.uint32(i)) & wp.uint32(1) != wp.uint32(0):
                store_word(stack, top + count, children[i])
                store_word(stack, stack_size + top + count, wp.cast(squared[i], wp.uint32))
                if squared[i] < least_squared:
                    least_squared = squared[i]
                    nearest = count
                count += 1
        if count > 1:
            last = top + count - 1
            child = load_word(stack, last)
            key = load_word(stack, stack_size + last)
            store_word(stack, last, load_word(stack, top + nearest))
            store_word(stack, stack_size + last, load_word(stack, stack_size + top + nearest))
            store_word(stack, top + nearest, child)
            store_word(stack, stack_size + top + nearest, key)
        return count

    @without_gradient
    @wp.func
    def test_leaf(units: wp.uint64, begin: int, block_count: int, point: wp.vec3d, best: Nearest) -> Nearest:
        for i in range(block_count):
            block = block_at(units, begin, i)
            for j in range(BLOCK_WIDTH):
                prim = wp.cast(load_float(units, prim_at(units, block, j)), wp.int32)
                if prim >= 0:
                    squared = squared_distance(corners_of(units, block, j), point)
                    ties = squared == best.squared and wp.uint32(prim) < wp.uint32(best.prim)
                    if squared < best.squared or ties:
                        best.squared = squared
                        best.prim = prim
                        best.block = block
                        best.lane = j
        return best

    @without_gradient
    @wp.func
    def search(tree: tree_type, given: vec3, most: real) -> Located:
        located = Located()
        located.distance = wp.float64(wp.inf)
        located.u = wp.float64(wp.nan)
        located.v = wp.float64(wp.nan)
        located.prim = NO_PRIM
        valid = bool(most >= real(0.0))
        for axis in range(3):
            if not (wp.abs(given[axis]) <= wp.static(largest)):
                valid = False
        if not valid:
            return located
        point = wp.vec3d(wp.float64(given[0]), wp.float64(given[1]), wp.float64(given[2]))
        center = wp.vec3d(wp.float64(tree.center[0]), wp.float64(tree.center[1]), wp.float64(tree.center[2]))
        frame = _frame(point - center, tree.extent)
        best = Nearest()
        reach = (wp.float64(most) + wp.static(least)) * wp.static(margin)
        best.squared = reach * reach
        best.prim = NO_PRIM
        limit = _box_limit(frame, best.squared)
        units = address_of(tree.units)
        all_words = wp.uint32(tree.units.shape[0])
        stack = new_stack()
        # The bottom of the stack is always near enough to be popped, and its child ends the traversal.
        store_word(stack, 0, ALL_BITS)
        store_word(stack, stack_size, wp.cast(-wp.inf, wp.uint32))
        top = int(1)
        child = int(0)
        steps = int(0)
        while child != END_OF_STACK:
            begin = child & WORD_MASK
            inner = child >= 0
            block_count = (child & 7) + 1
            end = wp.uint32(begin) + wp.uint32(wp.where(inner, node_words, block_count * block_words))
            steps += 1
            if steps > tree.step_limit or top > wp.static(stack_size - NODE_WIDTH) or end > all_words:
                tree.error[CORRUPTION] = 1
                break
            if inner:
                top += visit(units, begin, frame, limit, stack, top)
            else:
                best = test_leaf(units, begin, block_count, point, best)
                limit = _box_limit(frame, best.squared)
            top -= 1
            while wp.cast(load_word(stack, stack_size + top), wp.float32) > limit:
                top -= 1
            child = wp.cast(load_word(stack, top), wp.int32)
        distance = wp.float64(real(wp.sqrt(best.squared)))
        if best.prim != NO_PRIM and distance <= wp.float64(most):
            uv = closest_weights(corners_of(units, best.block, best.lane), point)
            located.distance = distance
            located.u = uv[0]
            located.v = uv[1]
            located.prim = best.prim
        return located

    return search
