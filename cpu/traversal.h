// WiVe: single-ray traversal of the 8-wide tree, the same steps for every node whatever it holds.
//
// Fuetterling, Lojewski, Pfreundt, Hamann, Ebert: "Accelerated Single Ray Tracing for Wide Vector Units", HPG 2017.
// Isa picks the instruction set, Slabs the form (full or half), Triangles the accuracy, Query what is asked,
// Counters whether steps are counted. A kernel holds only the code of what it was made for.
#pragma once

#include "frame.h"
#include "layout.h"
#include "query.h"
#include "ray.h"
#include "stack.h"

namespace wive {

struct NoCounters {
    [[gnu::always_inline]] void inner_node() {}
    [[gnu::always_inline]] void leaf() {}
    [[gnu::always_inline]] void block(const TriangleBlock&) {}
    [[gnu::always_inline]] void write(const HitBatch&, std::size_t) const {}
};

struct StepCounters {
    std::int32_t inner_nodes = 0, leaves = 0, triangles = 0;

    [[gnu::always_inline]] void inner_node() { ++inner_nodes; }
    [[gnu::always_inline]] void leaf() { ++leaves; }
    [[gnu::always_inline]] void block(const TriangleBlock& block) {
        for (const std::int32_t prim : block.prim) triangles += prim >= 0;
    }
    [[gnu::always_inline]] void write(const HitBatch& hits, std::size_t i) const {
        hits.stats[3 * i] = inner_nodes;
        hits.stats[3 * i + 1] = leaves;
        hits.stats[3 * i + 2] = triangles;
    }
};

// Starts loading four cache lines of what a child reference points to: a whole node, or one block and more. The
// address is an integer, because end_of_stack points nowhere; a prefetch of such an address does nothing.
[[gnu::always_inline]] inline void prefetch(const BvhView& bvh, std::uint32_t child) {
    const std::uintptr_t address = reinterpret_cast<std::uintptr_t>(bvh.units) + child_offset(child);
    for (unsigned line = 0; line < 4; ++line) __builtin_prefetch(reinterpret_cast<const void*>(address + 64 * line));
}

template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
[[gnu::noinline]] void traverse(const BvhView& bvh, const RayFrame<Isa>& ray, Query& result, Counters& counters) {
    const Slabs<Isa> slabs(ray);
    const Triangles<Isa> triangles(ray);
    Query query{ray.tmin, ray.tmax};
    Stack stack;
    Stack::Top top(stack);
    std::uint32_t child = inner_child(0);  // the root
    const auto take_next = [&] {
        top.move(-1);
        child = top.child();
    };
    // Children that have come to lie behind the best hit are passed over.
    const auto skip_hidden = [&] {
        if constexpr (Query::in_order)
            while (top.distance() > query.tmax) take_next();
    };
    for (;;) {
        while (is_inner(child)) {
            counters.inner_node();
            child = slabs.template visit<Query::in_order>(bvh.node(child), query.tmax, top);
            prefetch(bvh, top.child(-1));  // the one after next; the next is needed at once anyway
            skip_hidden();
        }
        if (child == end_of_stack) break;
        counters.leaf();
        const TriangleBlock* block = bvh.leaf(child);
        for (std::uint32_t i = 0; i < leaf_block_count(child); ++i) {
            counters.block(block[i]);
            if (triangles.test(block[i], query)) goto done;
        }
        take_next();
        skip_hidden();
    }
done:
    result = query;
}

template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
void trace_batch(const BvhView& bvh, const RayBatch& rays, const HitBatch& hits, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
        RayFrame<Isa> ray;
        Counters counters;
        if (!ray.load(bvh, rays, i)) {
            Query{0, 0}.write(hits, i, 1);
            counters.write(hits, i);
            continue;
        }
        Query query{0, 0};
        traverse<Isa, Slabs, Triangles>(bvh, ray, query, counters);
        query.write(hits, i, ray.scale);
        counters.write(hits, i);
    }
}

}  // namespace wive
