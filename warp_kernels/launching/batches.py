"""The loops over a launch's rays: that of a warp over its share, and that of a thread alone.

In a warp a lane whose ray has ended waits until several have, and these take the next rays of the warp's
share. In each round the warp votes whether to visit inner nodes or leaves, whichever more of its lanes wait
for. So most of its lanes are active in each instruction. What a ray finds does not depend on other rays.

A thread alone, as on Warp's CPU device, traces its rays one after another.
"""

import warp as wp

from wive.warp_kernels.lanes.lanes import address_of, without_gradient
from wive.warp_kernels.lanes.layout import END_OF_STACK
from wive.warp_kernels.lanes.warps import warp_of
from wive.warp_kernels.launching.outputs import ELEMENTS, OUTPUTS, RAYS, make_settle, make_start
from wive.warp_kernels.queries.frame import FRAMES, box_tmax, make_load_frame
from wive.warp_kernels.queries.query_exact import query_of
from wive.warp_kernels.traversal.alone import make_traverse
from wive.warp_kernels.traversal.slabs import make_meets_tree
from wive.warp_kernels.traversal.states import TRAVERSALS
from wive.warp_kernels.traversal.traversal import make_steps
from wive.warp_kernels.tree.handle import CORRUPTION, HANDLES

# Lanes that wait for rays before they are given some.
IDLE_LANES = 8


@wp.struct
class Share:
    """Where a lane is in its warp's share of the rays."""

    next_ray: wp.int32  # to be given to a lane; negative when the warp has no more to do


def make_loop(
    query: str,
    accuracy: str,
    length: int,
    stack_size: int,
    counters: bool,
    nodes: str,
    precision: str,
    in_warps: bool,
) -> wp.Function:
    """trace_share(tree, rays, out, thread, turns), for each thread of a launch.

    turns: the rays that a warp traces in all, over those that it traces at once.
    in_warps: threads loop in warps; otherwise each traces its rays alone, which takes lanes=8.
    """
    if in_warps:
        return _make_warp_loop(query, accuracy, length, stack_size, counters, nodes, precision)
    return _make_plain_loop(query, accuracy, stack_size, counters, nodes, precision)


def _make_load_ray(accuracy: str, precision: str) -> wp.Function:
    load_frame = make_load_frame(accuracy, precision)
    read, read_vec3 = ELEMENTS[precision].read, ELEMENTS[precision].read_vec3
    rays_type, frame_type = RAYS[precision], FRAMES[precision]

    @without_gradient
    @wp.func
    def load_ray(center: wp.vec3, rays: rays_type, i: int) -> frame_type:
        return load_frame(
            center,
            read_vec3(rays.origins, i),
            read_vec3(rays.directions, i),
            read(rays.tmin, wp.where(rays.tmin.shape[0] == 1, 0, i)),
            read(rays.tmax, wp.where(rays.tmax.shape[0] == 1, 0, i)),
        )

    return load_ray


def _make_plain_loop(
    query: str, accuracy: str, stack_size: int, counters: bool, nodes: str, precision: str
) -> wp.Function:
    steps = make_steps(query, accuracy, 8, stack_size, counters, nodes, precision)
    open_stack, new_stack = steps.open, steps.new_stack
    traverse = make_traverse(query, accuracy, stack_size, counters, nodes, precision, True)
    load_ray, meets_tree = _make_load_ray(accuracy, precision), make_meets_tree(FRAMES[precision])
    start = make_start(query, accuracy, precision)
    found_before, wanted = start.found, start.wanted
    settle = make_settle(query, accuracy, 8, counters, precision)
    tree_type, rays_type, outputs_type = HANDLES[accuracy, precision], RAYS[precision], OUTPUTS[precision]

    @without_gradient
    @wp.func
    def trace_share(tree: tree_type, rays: rays_type, out: outputs_type, thread: int, turns: int):
        units = address_of(tree.units)
        stack = new_stack()
        open_stack(stack)
        # In 64 bits: the last threads may have no rays, and theirs would begin beyond 2^31.
        count = wp.int64(rays.origins.shape[0])
        first = wp.int64(thread) * wp.int64(turns)
        for number in range(wp.int32(wp.min(first, count)), wp.int32(wp.min(first + wp.int64(turns), count))):
            ray = load_ray(tree.center, rays, number)
            goes = ray.valid and tree.error[CORRUPTION] == 0 and wanted(out, number)
            # Counters count the visit of the root, also of rays that miss it.
            if wp.static(not counters):
                goes = goes and meets_tree(tree.extent, ray)
            walk = traverse(tree, units, stack, ray, found_before(out, number, ray), goes)
            settle(out, number, 0, ray.unscale, walk, True)

    return trace_share


def _make_warp_loop(
    query: str, accuracy: str, length: int, stack_size: int, counters: bool, nodes: str, precision: str
) -> wp.Function:
    steps = make_steps(query, accuracy, length, stack_size, counters, nodes, precision)
    open_stack, keep, step = steps.open, steps.keep, steps.step
    keep_number, number_kept = steps.keep_number, steps.number_kept
    settled, unscale, new_stack, sync = steps.settled, steps.unscale, steps.new_stack, steps.sync
    warp = warp_of(length)
    vote, warp_index, warp_lane, lanes_below = warp.vote, warp.index, warp.lane, warp.lanes_below
    warp_rays, warp_width = warp.rays, warp.width
    threads: int = warp.threads
    start = make_start(query, accuracy, precision)
    found_before, wanted = start.found, start.wanted
    settle = make_settle(query, accuracy, length, counters, precision)
    load_ray = _make_load_ray(accuracy, precision)
    tree_type = HANDLES[accuracy, precision]
    walk_type = TRAVERSALS[query_of(query, accuracy, precision).state]
    rays_type, outputs_type = RAYS[precision], OUTPUTS[precision]

    @wp.func
    def vote_on(condition: bool):
        return vote(wp.where(condition, wp.uint32(1), wp.uint32(0)))

    @wp.func
    def rays_in(lanes: wp.uint32):
        """The number of rays that lanes of the warp trace."""
        return wp.int32(wp.bit_count(lanes)) // threads

    @wp.func
    def fewest_going(next_ray: int, end: int):
        """While there are rays, those that `IDLE_LANES` leave. One thread alone fetches when it is idle."""
        return wp.where(next_ray < end, wp.max(warp_width() - IDLE_LANES, 0), 0)

    @without_gradient
    @wp.func
    def trace_share(tree: tree_type, rays: rays_type, out: outputs_type, thread: int, turns: int):
        units = address_of(tree.units)
        lane = warp_lane(thread) & (threads - 1)
        # Numbers that change under conditions are fields of a struct: as variables they take more registers.
        share = Share()
        # In 64 bits: the last warps may have no rays, and theirs would begin beyond 2^31.
        count = wp.int64(rays.origins.shape[0])
        rays_per_warp = wp.int64(warp_rays() * turns)
        first = wp.int64(warp_index(thread)) * rays_per_warp
        share.next_ray = wp.int32(wp.min(first, count))
        end = wp.int32(wp.min(first + rays_per_warp, count))
        stack = new_stack()
        open_stack(stack)
        keep_number(stack, -1)  # none
        sync()
        walk = walk_type()
        walk.child = END_OF_STACK
        while share.next_ray >= 0:
            at_leaves = wp.int32(wp.bit_count(vote_on(walk.child < END_OF_STACK)))
            at_nodes = wp.int32(wp.bit_count(vote_on(walk.child > END_OF_STACK)))
            if at_leaves + at_nodes <= fewest_going(share.next_ray, end):
                ends = walk.child == END_OF_STACK
                idle = vote_on(ends)
                last = settled(units, lane, stack, walk)
                number = number_kept(stack)
                settle(out, number, lane, unscale(stack), last, ends and number >= 0)
                sync()  # the old ray's numbers have been read
                left = end - share.next_ray
                # One answer for the warp, whose threads may see the flag change at different times.
                sound = vote(wp.uint32(tree.error[CORRUPTION])) == wp.uint32(0)
                if ends:
                    place = rays_in(idle & lanes_below(thread))
                    number = wp.where(place < left, share.next_ray + place, -1)
                    keep_number(stack, number)
                    if place < left:
                        ray = load_ray(tree.center, rays, number)
                        keep(ray, stack)
                        walk.found = found_before(out, number, ray)
                        walk.tmax = box_tmax(ray.tmax)
                        walk.top = 1
                        walk.steps = 0
                        walk.inner_nodes = 0
                        walk.leaves = 0
                        walk.triangles = 0
                        if sound and ray.valid and wanted(out, number):
                            walk.child = 0
                share.next_ray = wp.where(left > 0, share.next_ray + wp.min(rays_in(idle), left), -1)
                sync()
            else:
                walk = step(tree, units, lane, stack, walk, at_leaves > at_nodes)

    return trace_share
