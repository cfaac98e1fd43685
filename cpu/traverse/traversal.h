// WiVe: single-ray traversal of the 8-wide tree, the same steps for every node whatever it holds.
//
// Fuetterling, Lojewski, Pfreundt, Hamann, Ebert: "Accelerated Single Ray Tracing for BigInt Vector Units", HPG 2017.
// Isa picks the instruction set, Slabs the form of the slab test and of the nodes, Triangles the accuracy, Query what
// is asked, Counters whether steps are counted. A kernel holds only the code of what it was made for.
#pragma once

#include "core/layout.h"
#include "core/ray.h"
#include "traverse/frame.h"
#include "traverse/query.h"
#include "traverse/query_all.h"
#include "traverse/stack.h"

namespace wive {

struct NoCounters {
    [[gnu::always_inline]] void inner_node() {}
    [[gnu::always_inline]] void leaf() {}
    [[gnu::always_inline]] void block(const auto&) {}
    [[gnu::always_inline]] void write(const auto&, std::size_t) const {}
};

struct StepCounters {
    std::int32_t inner_nodes = 0, leaves = 0, triangles = 0;

    [[gnu::always_inline]] void inner_node() { ++inner_nodes; }
    [[gnu::always_inline]] void leaf() { ++leaves; }
    [[gnu::always_inline]] void block(const auto& block) {
        for (int lane = 0; lane < block_width; ++lane) triangles += block.prim_at(lane) >= 0;
    }
    [[gnu::always_inline]] void write(const auto& hits, std::size_t i) const {
        hits.stats[3 * i] = inner_nodes;
        hits.stats[3 * i + 1] = leaves;
        hits.stats[3 * i + 2] = triangles;
    }
};

// Starts loading the first cache lines of what a child reference points to: a whole node, or one block and more. The
// address is an integer, because end_of_stack points nowhere; a prefetch of such an address does nothing.
template <class Layout>
[[gnu::always_inline]] inline void prefetch(const BvhView& bvh, std::uint32_t child) {
    const std::uintptr_t address = reinterpret_cast<std::uintptr_t>(bvh.units) + child_offset(child);
    for (unsigned line = 0; line < Layout::prefetched_lines; ++line)
        __builtin_prefetch(reinterpret_cast<const void*>(address + 64 * line));
}

// Offers the triangles of a leaf to the query; true once the query is done.
template <class Corners, class Triangles, class Query, class Counters>
[[gnu::always_inline]] inline bool test_leaf(const typename Corners::Block* block, std::uint32_t count,
                                             const Triangles& triangles, Query& query, Counters& counters) {
    for (; count > 0; --count, block = block->next()) {
        counters.block(*block);
        const Corners corners(*block);
        const auto found = triangles.find(corners);
        if (found.lanes != 0) [[unlikely]]
            if (triangles.solve(corners, found, query)) return true;
    }
    return false;
}

// Visits an inner node: the children that the ray meets go onto the stack, and top moves to the last of them, the
// nearest; or to the entry below, where none was met. No branch: the same steps for no hit and for eight.
template <bool in_order, class Isa, class Slabs>
[[gnu::always_inline]] inline void visit(const typename Slabs::Node& node, const Slabs& slabs, float tmax,
                                         Stack::Top& top) {
    const auto order = slabs.order(node);                                               // (A) order
    const auto [tnear, hit] = slabs.test(node, tmax);                                   // (B) slabs
    const typename Isa::template Lanes<in_order> lanes(order, hit, tnear, node.child);  // (C) permute,
    lanes.compress_to(top);                                                             //     compress,
    top.move(static_cast<std::ptrdiff_t>(hit.count()) - 1);                             // (D) store
}

// The same for one ray on its own, whose next step can't begin before the next child is known: branches for what need
// not wait for the permute and the stack. Nothing hit: predicted, the processor goes on with what lies below on
// the stack while this node's boxes are still being decided. One child hit: it is next, and the stack stays as it is.
// 40 cycles a node without them, 21 with them, where rays are alike (docs/design.md). Without an order there is no
// permute to wait for: the node itself has the child, one hit or several. Children are prefetched when they come to lie
// one and two below the top: the top is needed at once anyway.
template <bool in_order, class Isa, class Slabs>
[[gnu::always_inline]] inline std::uint32_t visit_and_take(const BvhView& bvh, const typename Slabs::Node& node,
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
    const typename Isa::template Lanes<in_order> lanes(order, hit, tnear, node.child);
    lanes.compress_to(top);
    top.move(static_cast<std::ptrdiff_t>(count) - 1);
    prefetch<Layout>(bvh, top.child(-1));
    prefetch<Layout>(bvh, top.child(-2));
    if constexpr (in_order)
        return lanes.last_hit();
    else
        return node.child[hit.last()];
}

// What ray i asks, before anything is found. Only the query for every hit knows whose hits they are.
template <class Query, class Isa>
[[gnu::always_inline]] inline Query query_of(const RayFrame<Isa>& ray, const HitBatch<typename Isa::Real>& hits,
                                             std::size_t i) {
    if constexpr (requires { &Query::found; })
        return {.interval = ray.interval, .scale = ray.scale, .ray = i, .found = hits.found};
    else
        return {ray.interval};
}

// From the root down, for one ray or for several that go together. reach(): how far hits still count.
// at_node(child, top): called before an inner node is visited. at_leaf(child, top): true once nothing more is asked.
template <bool in_order, class Isa, class Slabs>
[[gnu::always_inline]] inline void walk(const BvhView& bvh, const Slabs& slabs, Stack& stack, const auto& reach,
                                        const auto& at_node, const auto& at_leaf) {
    using Layout = typename Slabs::Layout;
    Stack::Top top(stack);
    std::uint32_t child = inner_child(0);  // the root
    if constexpr (in_order)
        top.distance() = -std::numeric_limits<float>::infinity();  // looked at where one child is hit
    const auto take_next = [&] {
        top.move(-1);
        child = top.child();
    };
    // Children that have come to lie behind the best hit are passed over.
    const auto skip_hidden = [&] {
        if constexpr (in_order)
            while (top.distance() > reach()) take_next();
    };
    for (;;) {
        while (is_inner(child)) {
            at_node(child, top);
            child = visit_and_take<in_order, Isa>(bvh, bvh.template node<Layout>(child), slabs, reach(), top);
            skip_hidden();
        }
        if (child == end_of_stack || at_leaf(child, top)) return;
        take_next();
        skip_hidden();
        prefetch<Layout>(bvh, top.child(-2));
    }
}

// Comes with what is asked in `result` and leaves the answer there; meanwhile it is in registers.
template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
[[gnu::noinline]] void traverse(const BvhView& bvh, const typename Triangles<Isa>::Frame& ray, Query& result,
                                Counters& counters) {
    using Layout = typename Slabs<Isa>::Layout;
    using Corners = typename Layout::template Corners<Isa>;
    Query query = result;
    Stack stack;
    walk<Query::in_order, Isa>(
        bvh, Slabs<Isa>(ray), stack, [&] { return query.interval.box_tmax(); },
        [&](std::uint32_t, const Stack::Top&) { counters.inner_node(); },
        [&](std::uint32_t child, const Stack::Top&) {
            counters.leaf();
            const Triangles<Isa> triangles(ray);  // made here: registers are for what nodes need
            return test_leaf<Corners>(bvh.template leaf<Layout>(child), leaf_block_count(child), triangles, query,
                                      counters);
        });
    result = query;
}

template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
void trace_one_by_one(const BvhView& bvh, const RayBatch<typename Isa::Real>& rays,
                      const HitBatch<typename Isa::Real>& hits, const RaySource& source) {
    for (std::size_t begin, end; source.take(begin, end);)
        for (std::size_t i = begin; i < end; ++i) {
            typename Triangles<Isa>::Frame ray;
            Query query{};
            Counters counters;
            ray.scale = 1;
            if (ray.load(bvh, rays, i)) {
                query = query_of<Query>(ray, hits, i);
                traverse<Isa, Slabs, Triangles>(bvh, ray, query, counters);
            }
            query.write(hits, i, ray.scale);
            counters.write(hits, i);
        }
}

}  // namespace wive
