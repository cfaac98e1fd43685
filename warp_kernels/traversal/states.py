"""The structs that a traversal and the test of a leaf return, for each type of what a query has found."""

from typing import Any

import warp as wp

from wive.warp_kernels.queries.query import Best, Best64, MultiHit, MultiHit64
from wive.warp_kernels.queries.query_exact import ExactBest
from wive.warp_kernels.tree.handle import derive_struct


@wp.struct
class Traversal:
    """One thread's traversal of one ray: its own hits, and what the ray's threads share."""

    found: Best
    tmax: wp.float32  # for boxes
    child: wp.int32  # to be visited next; END_OF_STACK when the traversal has ended
    top: wp.int32  # of the stack
    steps: wp.int32
    inner_nodes: wp.int32
    leaves: wp.int32
    triangles: wp.int32


@wp.struct
class Step:
    """What a thread does in a step."""

    goes: wp.int32  # above zero if it takes part
    count: wp.int32  # of children that it puts on the stack


@wp.struct
class TestedLeaf:
    """What one thread has found after a leaf, and the last block that it tested."""

    found: Best
    last: wp.int32


TRAVERSALS: dict[Any, Any] = {Best: Traversal}
LEAVES: dict[Any, Any] = {Best: TestedLeaf}
for _state in (MultiHit, ExactBest, Best64, MultiHit64):
    for _structs in (TRAVERSALS, LEAVES):
        _base = _structs[Best]
        _doc = f"`{_base.key}` of a query that keeps `{_state.key}`."
        _structs[_state] = derive_struct(_base, _base.key + _state.key, _doc, found=_state)
