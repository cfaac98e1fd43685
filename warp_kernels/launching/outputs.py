"""What a launch reads of each ray and writes for it, by query."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from wive.warp_kernels.lanes.lanes import without_gradient
from wive.warp_kernels.lanes.layout import ALL_BITS, NO_PRIM
from wive.warp_kernels.lanes.native import READ_ELEMENT, WRITE_ELEMENT
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.lanes.warps import collectives
from wive.warp_kernels.queries.frame import FRAMES, box_tmax
from wive.warp_kernels.queries.query_exact import query_of
from wive.warp_kernels.traversal.states import TRAVERSALS
from wive.warp_kernels.tree.handle import LISTED_HITS, ListedHit, derive_struct


@wp.struct
class Rays:
    """The rays of a launch; limits are one per ray, or one for all rays."""

    origins: wp.array(dtype=wp.vec3)
    directions: wp.array(dtype=wp.vec3)
    tmin: wp.array(dtype=wp.float32)
    tmax: wp.array(dtype=wp.float32)


@wp.struct
class Outputs:
    """What a launch writes; the arrays of other queries are null."""

    t: wp.array(dtype=wp.float32)
    prim: wp.array(dtype=wp.int32)
    uv: wp.array(dtype=wp.vec2)
    occluded: wp.array(dtype=wp.bool)
    counts: wp.array(dtype=wp.int32)
    stats: wp.array(dtype=wp.vec3i)
    offsets: wp.array(dtype=wp.int64)  # of all hits: where each ray's begin
    remaining: wp.array(dtype=wp.int32)  # how many of them are still to be listed
    hits: wp.array(dtype=ListedHit)


def _in_double(base: Any, name: str, **more: Any) -> Any:
    doubles = {wp.float32: wp.float64, wp.vec2: wp.vec2d, wp.vec3: wp.vec3d}
    fields = base.cls.__annotations__
    changed = {
        field: wp.array(dtype=doubles[kind.dtype]) for field, kind in fields.items() if kind.dtype in doubles
    }
    return derive_struct(base, name, f"`{base.key}` in a float64 tree.", **changed, **more)


RAYS: dict[str, Any] = {"float32": Rays, "float64": _in_double(Rays, "Rays64")}
OUTPUTS: dict[str, Any] = {
    "float32": Outputs,
    "float64": _in_double(Outputs, "Outputs64", hits=wp.array(dtype=LISTED_HITS["float64"])),
}


def _elements(dtype: Any, code: str) -> tuple[wp.Function, wp.Function]:
    """Functions that read and write an element of an array."""

    @wp.func_native(READ_ELEMENT.replace("TYPE", code))
    def read(values: wp.array(dtype=dtype), i: int) -> dtype: ...

    @wp.func_native(WRITE_ELEMENT.replace("TYPE", code))
    def write(values: wp.array(dtype=dtype), i: int, value: dtype): ...

    return without_gradient(read), without_gradient(write)


def _elements_of(precision: str) -> SimpleNamespace:
    numbers = PRECISIONS[precision]
    read_vec3, _ = _elements(numbers.vec3, f"wp::vec_t<3, wp::{precision}>")
    _, write_vec2 = _elements(numbers.vec2, f"wp::vec_t<2, wp::{precision}>")
    read, write = _elements(numbers.real, f"wp::{precision}")
    return SimpleNamespace(read_vec3=read_vec3, write_vec2=write_vec2, read=read, write=write)


ELEMENTS = {precision: _elements_of(precision) for precision in PRECISIONS}
_, write_int = _elements(wp.int32, "wp::int32")
_, write_bool = _elements(wp.bool, "bool")
_, write_steps = _elements(wp.vec3i, "wp::vec_t<3, wp::int32>")


@wp.func_native("return (wp::uint64)(remaining.data + i);")
def address_of_count(remaining: wp.array(dtype=wp.int32), i: int) -> wp.uint64:
    """Address of the ray's remaining-hit counter."""
    ...


def make_start(query: str, accuracy: str, precision: str) -> SimpleNamespace:
    """found(out, i, ray): the state before the i-th ray is traced; wanted(out, i): whether it is traced."""
    query_type = query_of(query, accuracy, precision)
    begin, found_type, frame_type = query_type.begin, query_type.state, FRAMES[precision]
    outputs_type, hit_type = OUTPUTS[precision], LISTED_HITS[precision]
    lists: bool = query in ("all", "all_touching")

    @wp.func_native("return (wp::uint64)(hits.data + first);")
    def address_of_hit(hits: wp.array(dtype=hit_type), first: wp.int64) -> wp.uint64:
        """Address of the ray's first hit."""
        ...

    @without_gradient
    @wp.func
    def found(out: outputs_type, i: int, ray: frame_type) -> found_type:
        nothing = begin(ray)
        if wp.static(lists):
            nothing.unscale = ray.unscale
            nothing.hits = address_of_hit(out.hits, out.offsets[i])
            nothing.remaining = address_of_count(out.remaining, i)
        return nothing

    @without_gradient
    @wp.func
    def wanted(out: outputs_type, i: int):
        # A ray whose count is zero is not traced again.
        if wp.static(lists):
            return out.offsets[i + 1] != out.offsets[i]
        return True

    return SimpleNamespace(found=found, wanted=wanted)


def make_settle(query: str, accuracy: str, length: int, counters: bool, precision: str) -> wp.Function:
    """settle(out, i, lane, unscale, walk, ended) writes the i-th ray's results, if its traversal has ended.

    All threads of a warp call it together.
    """
    real, vec2 = PRECISIONS[precision].real, PRECISIONS[precision].vec2
    write, write_vec2 = ELEMENTS[precision].write, ELEMENTS[precision].write_vec2
    query_type = query_of(query, accuracy, precision)
    distance = query_type.distance
    outputs_type = OUTPUTS[precision]
    walk_type = TRAVERSALS[query_type.state]
    group = collectives(length)
    group_vote, min_reduce, sum_reduce = group.group_vote, group.min_reduce, group.sum_reduce

    @without_gradient
    @wp.func
    def write_counters(out: outputs_type, i: int, walk: walk_type):
        if wp.static(counters):
            write_steps(out.stats, i, wp.vec3i(walk.inner_nodes, walk.leaves, walk.triangles))

    @without_gradient
    @wp.func
    def settle_closest(out: outputs_type, i: int, lane: int, unscale: real, walk: walk_type, ended: bool):
        own = wp.uint32(walk.found.prim)
        if wp.static(length == 1):
            if box_tmax(walk.found.t) != walk.tmax:
                own = ALL_BITS
        winner = min_reduce(own)
        if ended:
            if winner == ALL_BITS:
                if lane == 0:
                    write(out.t, i, real(wp.inf))
                    write_int(out.prim, i, NO_PRIM)
                    if out.uv:
                        write_vec2(out.uv, i, vec2(real(wp.nan), real(wp.nan)))
            elif own == winner:
                write(out.t, i, distance(walk.found, unscale))
                write_int(out.prim, i, walk.found.prim)
                if out.uv:
                    write_vec2(out.uv, i, vec2(walk.found.u, walk.found.v))
            if lane == 0:
                write_counters(out, i, walk)

    @without_gradient
    @wp.func
    def settle_any(out: outputs_type, i: int, lane: int, unscale: real, walk: walk_type, ended: bool):
        hit = group_vote(wp.where(walk.found.prim == NO_PRIM, wp.uint32(0), wp.uint32(1)))
        if ended and lane == 0:
            write_bool(out.occluded, i, hit != wp.uint32(0))
            write_counters(out, i, walk)

    @without_gradient
    @wp.func
    def settle_count(out: outputs_type, i: int, lane: int, unscale: real, walk: walk_type, ended: bool):
        count = sum_reduce(wp.uint32(walk.found.count))
        if ended and lane == 0:
            write_int(out.counts, i, wp.int32(count))
            write_counters(out, i, walk)

    @without_gradient
    @wp.func
    def settle_all(out: outputs_type, i: int, lane: int, unscale: real, walk: walk_type, ended: bool):
        pass

    functions = {"closest": settle_closest, "any": settle_any, "all": settle_all, "all_touching": settle_all}
    return functions.get(query, settle_count)
