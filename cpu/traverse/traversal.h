// WiVe: single-ray traversal of the 8-wide BVH.
//
// Fuetterling, Lojewski, Pfreundt, Hamann, Ebert: "Accelerated Single Ray Tracing for Wide Vector Units", HPG 2017.
//
// Which loop runs: single rays and packets run walk(), below. A batch of 16 rays or more runs InFlight::trace
// (in_flight.h), which calls visit() for many rays in turns and passes coherent neighbours to Packet::trace (packet.h).
//
// Template parameters, with their contracts in concepts.h:
//   I          the instruction set: its vectors, masks and compress.
//   Slabs      the slab test, and with it the layout of nodes and triangle blocks.
//   Triangles  the triangle test: fast, watertight or exact.
//   Query      what is kept of the hits: the closest, whether there is any, all of them, or their number.
//   Counters   StepCounters if the steps of each ray are counted, else NoCounters.
//   in_order   when true, children are pushed farthest first with their distances, and skipped behind the best hit.
// A kernel contains only the code of its own combination.
#pragma once

#include <cassert>

#include "core/layout.h"
#include "core/ray.h"
#include "traverse/box_misses.h"
#include "traverse/concepts.h"
#include "traverse/counters.h"
#include "traverse/frame.h"
#include "traverse/query.h"
#include "traverse/query_all.h"
#include "traverse/stack.h"

namespace wive::WIVE_ISA {

// Visits an inner node: pushes the children whose boxes are hit and moves top to the last of them, the nearest if
// in_order; if none is hit, to the entry below. No branch: the steps are the same for no hit and for eight.
template <bool in_order, Isa I, SlabTest<I> Slabs>
[[gnu::always_inline]] inline void visit(const typename Slabs::Node& node, const Slabs& slabs, float tmax,
                                         Stack::Top& top);

// Visits an inner node and returns the child that is next, for a traversal that has the thread to itself.
template <bool in_order, Isa I, SlabTest<I> Slabs>
[[gnu::always_inline]] inline std::uint32_t visit_and_pop(const BvhView& bvh, const typename Slabs::Node& node,
                                                          const Slabs& slabs, float tmax, Stack::Top& top);

// What a walk does next.
enum class Walk { visit, skip, end };

// Walks the tree from the root, for one ray or for a packet. make_slabs(): the slab test, made anew before the first
// node after a leaf. box_tmax(): the distance up to which hits still count. at_node(child, top) tells what to do at an
// inner node, at_leaf(child, top) at a leaf after testing it: visit goes on.
template <bool in_order, Isa I>
[[gnu::always_inline]] inline void walk(const BvhView& bvh, const auto& make_slabs, Stack& stack, const auto& box_tmax,
                                        const auto& at_node, const auto& at_leaf);

// Traces one ray. result: in, the query before any hit; out, its result.
template <Isa I, template <class> class Slabs, template <class> class Triangles, class Query, StepCounter Counters>
    requires Traversable<I, Slabs, Triangles, Query>
[[gnu::noinline]] void traverse(const BvhView& bvh, const typename Triangles<I>::Frame& ray, Query& result,
                                Counters& counters);

// Traces the rays of a source one after another.
template <Isa I, template <class> class Slabs, template <class> class Triangles, class Query, StepCounter Counters>
    requires Traversable<I, Slabs, Triangles, Query>
void trace_one_by_one(const BvhView& bvh, const RayBatch<typename I::Real>& rays,
                      const HitBatch<typename I::Real>& hits, const RaySource& source);

// Offers the hits in a leaf of `count` blocks to the query; true once the query is done.
template <class Corners, class Triangles, class Query, StepCounter Counters>
    requires TriangleTest<Triangles, Corners, Query>
[[gnu::always_inline]] inline bool test_leaf(const typename Corners::Block* block, std::uint32_t count,
                                             const Triangles& triangles, Query& query, Counters& counters);

// Prefetches the first cache lines of a child: a whole node, or one block and more.
template <class Layout>
[[gnu::always_inline]] inline void prefetch(const BvhView& bvh, std::uint32_t child);

// The same object, of whose values the compiler knows none: they are loaded where they are next needed. Nodes and
// leaves need more registers than there are, so without this the compiler keeps what a node needs on the stack all the
// time, because leaves use the registers, and loads it at each node.
template <class T>
[[gnu::always_inline]] inline const T& read_again(const T& object);

// The query of ray i before any hit.
template <class Query, Isa I>
[[gnu::always_inline]] inline Query start_query(const RayFrame<I>& ray, const HitBatch<typename I::Real>& hits,
                                                std::size_t i);

template <bool in_order, Isa I, SlabTest<I> Slabs>
[[gnu::always_inline]] inline void visit(const typename Slabs::Node& node, const Slabs& slabs, float tmax,
                                         Stack::Top& top) {
    const auto order = slabs.order(node);                                             // (A) order
    const auto [tnear, hit] = slabs.test(node, tmax);                                 // (B) slabs
    const typename I::template Lanes<in_order> lanes(order, hit, tnear, node.child);  // (C) permute,
    lanes.compress_to(top);                                                           //     compress,
    top.move(static_cast<std::ptrdiff_t>(hit.count()) - 1);                           // (D) store
}

// A traversal alone on its thread can't go on before the next child is known, so two branches let the processor predict
// that child instead of waiting for the permute and the stack. No box hit: the entry below is next, and work on it
// starts while this node's boxes are still being decided. One box hit: its child is next, and the stack stays as it
// is. Coherent rays need 40 cycles per node without these branches and 21 with them (docs/design.md). Without an order
// there is no permute, so the node's own row has the child for any number of hits. Prefetched are the entries one and
// two below the top: the top itself is needed at once.
template <bool in_order, Isa I, SlabTest<I> Slabs>
[[gnu::always_inline]] inline std::uint32_t visit_and_pop(const BvhView& bvh, const typename Slabs::Node& node,
                                                          const Slabs& slabs, float tmax, Stack::Top& top) {
    using Layout = typename Slabs::Layout;
    const auto order = slabs.order(node);
    const auto [tnear, hit] = slabs.test(node, tmax);
    const unsigned count = hit.count();
    if (count == 0) {
        top.move(-1);
        prefetch<Layout>(bvh, top.child(-2));
        return top.child();
    }
    if constexpr (in_order)
        if (count == 1) {
            prefetch<Layout>(bvh, top.child(-1));
            return node.child[hit.first()];
        }
    const typename I::template Lanes<in_order> lanes(order, hit, tnear, node.child);
    lanes.compress_to(top);
    top.move(static_cast<std::ptrdiff_t>(count) - 1);
    prefetch<Layout>(bvh, top.child(-1));
    prefetch<Layout>(bvh, top.child(-2));
    if constexpr (in_order)
        return lanes.last_hit();
    else
        return node.child[hit.last()];
}

template <bool in_order, Isa I>
[[gnu::always_inline]] inline void walk(const BvhView& bvh, const auto& make_slabs, Stack& stack, const auto& box_tmax,
                                        const auto& at_node, const auto& at_leaf) {
    using Slabs = decltype(make_slabs());
    static_assert(SlabTest<Slabs, I>);
    using Layout = typename Slabs::Layout;
    Stack::Top top(stack);
    std::uint32_t child = inner_child(0);  // the root
    if constexpr (in_order)
        top.distance() = -std::numeric_limits<float>::infinity();  // read if the root has one child hit
    const auto pop = [&] {
        top.move(-1);
        child = top.child();
    };
    // Pops the children that lie behind the best hit found since they were pushed.
    const auto pop_hidden = [&] {
        if constexpr (in_order)
            while (top.distance() > box_tmax()) pop();
    };
    for (;;) {
        if (is_inner(child)) {
            const Slabs slabs = make_slabs();
            do {
                const Walk next = at_node(child, top);
                if (next == Walk::end) return;
                if (next == Walk::visit)
                    child = visit_and_pop<in_order, I>(bvh, bvh.template node<Layout>(child), slabs, box_tmax(), top);
                else
                    pop();
                pop_hidden();
            } while (is_inner(child));
        }
        if (child == end_of_stack || at_leaf(child, top) == Walk::end) return;
        pop();
        pop_hidden();
        prefetch<Layout>(bvh, top.child(-2));
    }
}

template <Isa I, template <class> class Slabs, template <class> class Triangles, class Query, StepCounter Counters>
    requires Traversable<I, Slabs, Triangles, Query>
[[gnu::noinline]] void traverse(const BvhView& bvh, const typename Triangles<I>::Frame& ray, Query& result,
                                Counters& counters) {
    using Layout = typename Slabs<I>::Layout;
    using Corners = typename Layout::template Corners<I>;
    assert(ray.is_finite());
    Query query = result;  // a local, so that it stays in registers
    const OctantRows rows(ray.order_shift);
    Stack stack;
    walk<Query::in_order, I>(
        bvh, [&] { return Slabs<I>(read_again(ray), rows); }, stack, [&] { return query.interval.box_tmax(); },
        [&](std::uint32_t, const Stack::Top&) {
            counters.inner_node();
            return Walk::visit;
        },
        [&](std::uint32_t child, const Stack::Top&) {
            counters.leaf();
            const Triangles<I> triangles(ray);  // made here: while nodes are visited, they need the registers
            const bool done = test_leaf<Corners>(bvh.template leaf<Layout>(child), leaf_block_count(child), triangles,
                                                 query, counters);
            return done ? Walk::end : Walk::visit;
        });
    result = query;
}

template <Isa I, template <class> class Slabs, template <class> class Triangles, class Query, StepCounter Counters>
    requires Traversable<I, Slabs, Triangles, Query>
void trace_one_by_one(const BvhView& bvh, const RayBatch<typename I::Real>& rays,
                      const HitBatch<typename I::Real>& hits, const RaySource& source) {
    const auto is_known_to_miss = [&](std::size_t i) {
        if constexpr (Slabs<I>::Layout::boxes_are_nested || !std::is_same_v<Counters, NoCounters>) return false;
        return leads_away<I>(bvh, rays, i);
    };
    for (std::size_t begin, end; source.take(begin, end);)
        for (std::size_t i = begin; i < end; ++i) {
            typename Triangles<I>::Frame ray;
            Query query{};
            Counters counters;
            ray.unscale = 1;
            if (!is_known_to_miss(i) && ray.load(bvh, rays, i)) {
                query = start_query<Query>(ray, hits, i);
                traverse<I, Slabs, Triangles>(bvh, ray, query, counters);
            }
            query.write(hits, i, ray.unscale);
            counters.write(hits, i);
        }
}

template <class Corners, class Triangles, class Query, StepCounter Counters>
    requires TriangleTest<Triangles, Corners, Query>
[[gnu::always_inline]] inline bool test_leaf(const typename Corners::Block* block, std::uint32_t count,
                                             const Triangles& triangles, Query& query, Counters& counters) {
    assert(count >= 1 && count <= max_leaf_blocks);
    for (; count > 0; --count, block = block->next()) {
        counters.block(*block);
        const Corners corners(*block);
        const auto found = triangles.find(corners);
        if (found.hit_mask != 0) [[unlikely]]
            if (triangles.solve(corners, found, query)) return true;
    }
    return false;
}

// The address is an integer, because end_of_stack points nowhere; prefetching such an address does nothing.
template <class Layout>
[[gnu::always_inline]] inline void prefetch(const BvhView& bvh, std::uint32_t child) {
    const std::uintptr_t address = reinterpret_cast<std::uintptr_t>(bvh.units) + child_offset(child);
    for (unsigned line = 0; line < Layout::prefetched_lines; ++line)
        __builtin_prefetch(reinterpret_cast<const void*>(address + 64 * line));
}

template <class T>
[[gnu::always_inline]] inline const T& read_again(const T& object) {
    const T* pointer = &object;
    asm volatile("" : "+r"(pointer));
    return *pointer;
}

// Queries of several hits know which they take; AllHits alone records whose hits they are, in the caller's units.
template <class Query, Isa I>
[[gnu::always_inline]] inline Query start_query(const RayFrame<I>& ray, const HitBatch<typename I::Real>& hits,
                                                std::size_t i) {
    if constexpr (requires { &Query::found; })
        return {.interval = ray.interval,
                .crossings = hits.crossings,
                .unscale = ray.unscale,
                .ray = i,
                .found = hits.found};
    else if constexpr (requires { &Query::count; })
        return {.interval = ray.interval, .crossings = hits.crossings};
    else
        return {ray.interval};
}

}  // namespace wive::WIVE_ISA
