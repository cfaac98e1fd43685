// Many rays in flight on one thread: each does exactly the single-ray traversal, one step at a time in turns.
//
// One ray's next node is known only when its last is done, and then it may have to come from memory. Here the others
// take their turns meanwhile: a ray's next node or leaf is prefetched when it becomes known and visited a round later.
// Hits are those of the single ray, bit for bit: nothing passes between rays. Rays that go together need no turns:
// packet.h.
#pragma once

#include <new>
#include <type_traits>

#include "traverse/packet.h"
#include "traverse/traversal.h"

namespace wive {

template <class Frame, class Query, class Counters>
struct alignas(64) Flight {
    Frame ray;
    Query query{};
    [[no_unique_address]] Counters counters;
    Stack::Top top;
    std::size_t index = 0;  // of the ray in its batch
    Stack stack;
};

template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
class InFlight {
    using Rays = RayBatch<typename Isa::Real>;
    using Hits = HitBatch<typename Isa::Real>;

    using Together = Packets<Isa, Slabs, Triangles, Query>;

public:
    // Kernels that count do so for each ray alone.
    using PacketsOrNone =
        std::conditional_t<std::is_same_v<Counters, NoCounters> && Together::bit_exact, Together, NoPackets>;
    using State = Flight<typename Triangles<Isa>::Frame, Query, Counters>;
    using Layout = typename Slabs<Isa>::Layout;
    using Corners = typename Layout::template Corners<Isa>;

    [[gnu::always_inline]] InFlight(const BvhView& bvh, const Rays& rays, const Hits& hits, const RaySource& source,
                                    PacketsOrNone& packets, std::byte* scratch)
        : bvh_(bvh),
          rays_(rays),
          hits_(hits),
          source_(source),
          packets_(packets),
          flights_(reinterpret_cast<State*>(scratch)) {}

    void trace(unsigned in_flight) {
        for (unsigned i = 0; i < in_flight; ++i) {
            start(*new (flights_ + i) State);
        }
        while (ends_.node != at_node_ || ends_.leaf != at_leaf_) {
            visit_nodes();
            test_leaves();
            finish_and_replace();
        }
    }

private:
    // A block some of whose triangles a flight may hit.
    struct Candidate {
        State* flight;
        const typename Layout::Block* block;
        bool last_block;
        typename Triangles<Isa>::Found found;
    };

    // One past the last flight of each queue: flights that wait for the same kind of step stand together, so that
    // each kind has a loop to itself and no step has to ask.
    struct Ends {
        State **node, **leaf, **done;
    };

    // Puts the next ray that can hit anything into a flight's place; rays that can't are answered here.
    void start(State& f) {
        for (;; ++next_) {
            do {
                if (next_ == end_ && !source_.take(next_, end_)) {
                    end_ = next_;
                    return;
                }
            } while (packets_.trace_next(next_, end_));
            new (&f.query) Query{};  // in place: a temporary copied over would stall on its own stores
            f.counters = Counters{};
            if (f.ray.load(bvh_, rays_, next_)) break;
            f.query.write(hits_, next_, 1);
            f.counters.write(hits_, next_);
        }
        f.index = next_++;
        new (&f.query) Query(query_of<Query>(f.ray, hits_, f.index));
        f.top = Stack::Top(f.stack);
        f.top.child() = inner_child(0);  // the root
        *ends_.node++ = &f;
    }

    // The child on top is next, unless it may be hidden, which a leaf that was begun may not: prefetched now and, where
    // nothing is left to be done before, waited for in the right queue. Written to all three, and counted in one: no
    // branch.
    [[gnu::always_inline]] static void wait(const BvhView& bvh, State& f, bool may_hide, bool ready, Ends& ends) {
        Stack::Top top = f.top;
        if constexpr (Query::in_order)
            while (may_hide & (top.distance() > f.query.interval.box_tmax())) top.move(-1);
        f.top = top;
        const std::uint32_t child = top.child();
        prefetch<Layout>(bvh, child);
        const bool inner = is_inner(child), end = child == end_of_stack;
        *ends.node = *ends.leaf = *ends.done = &f;
        ends.node += ready & inner;
        ends.leaf += ready & !inner & !end;
        ends.done += ready & end;
    }

    // A few nodes are visited before their flights are sorted into queues: the one is without a branch, and what is
    // guessed wrong in the other throws away little. Not all of them, though: prefetches must have something to hide
    // behind.
    [[gnu::always_inline]] void visit_nodes() {
        constexpr std::ptrdiff_t few = 8;
        const BvhView bvh = bvh_;
        State** const last = ends_.node;
        Ends ends = {at_node_, ends_.leaf, ends_.done};  // refilled from the front, never past the flight at hand
        for (State** i = at_node_; i != last;) {
            State** const next = last - i < few ? last : i + few;
            for (State** j = i; j != next; ++j) {
                State& f = **j;
                Stack::Top top = f.top;
                f.counters.inner_node();
                visit<Query::in_order, Isa>(bvh.template node<Layout>(top.child()), Slabs<Isa>(f.ray),
                                            f.query.interval.box_tmax(), top);
                f.top = top;
            }
            for (; i != next; ++i) wait(bvh, **i, true, true, ends);
        }
        ends_ = ends;
    }

    // One block a turn: a leaf of several stays on top, so that the next one is prefetched, and no loop has to be left.
    // First all blocks are asked which of their triangles may be hit; then those few are solved, one after the other
    // without a guess whether there is anything to solve; and only then do their rays know what to do next.
    [[gnu::always_inline]] void test_leaves() {
        const BvhView bvh = bvh_;
        State** const last = ends_.leaf;
        Ends ends = {ends_.node, at_leaf_, ends_.done};
        Candidate* end = candidates_;
        for (State** i = at_leaf_; i != last; ++i) {
            State& f = **i;
            Stack::Top top = f.top;
            const std::uint32_t child = top.child();
            const auto& block = *bvh.template leaf<Layout>(child);
            const bool last_block = leaf_block_count(child) == 1;
            f.counters.block(block);
            if (last_block) f.counters.leaf();
            top.child() =
                without_first_block(child, block.units());  // no matter if it was the last: above the top then
            top.move(-static_cast<std::ptrdiff_t>(last_block));
            *end = {&f, &block, last_block, Triangles<Isa>(f.ray).find(Corners(block))};
            const bool found = end->found.lanes != 0;
            end += found;
            f.top = top;
            wait(bvh, f, last_block, !found, ends);
        }
        for (const Candidate* c = candidates_; c != end; ++c) {
            State& f = *c->flight;
            if (Triangles<Isa>(f.ray).solve(Corners(*c->block), c->found, f.query)) {
                f.top = Stack::Top(f.stack);
                f.top.move(-1);
                if (!c->last_block) f.counters.leaf();
            }
        }
        for (const Candidate* c = candidates_; c != end; ++c) wait(bvh, *c->flight, c->last_block, true, ends);
        ends_ = ends;
    }

    [[gnu::always_inline]] void finish_and_replace() {
        State** const last = ends_.done;
        ends_.done = done_;
        for (State** i = done_; i != last; ++i) {
            State& f = **i;
            f.query.write(hits_, f.index, f.ray.scale);
            f.counters.write(hits_, f.index);
            start(f);
        }
    }

    const BvhView bvh_;
    const Rays rays_;
    const Hits hits_;
    const RaySource source_;
    PacketsOrNone& packets_;
    State* flights_;
    State *at_node_[max_in_flight + 1], *at_leaf_[max_in_flight + 1], *done_[max_in_flight + 1];
    Candidate candidates_[max_in_flight + 1];
    Ends ends_ = {at_node_, at_leaf_, done_};
    std::size_t next_ = 0, end_ = 0;
};

template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
void trace_batch(const BvhView& bvh, const RayBatch<typename Isa::Real>& rays, const HitBatch<typename Isa::Real>& hits,
                 const RaySource& source, unsigned in_flight, std::byte* scratch) {
    if (in_flight <= 1) {
        trace_one_by_one<Isa, Slabs, Triangles, Query, Counters>(bvh, rays, hits, source);
    } else {
        using Flights = InFlight<Isa, Slabs, Triangles, typename Query::InFlight, Counters>;
        typename Flights::PacketsOrNone packets(bvh, rays, hits, in_flight);
        Flights(bvh, rays, hits, source, packets, scratch).trace(in_flight);
    }
}

}  // namespace wive
