// Many rays in flight on one thread, each traversed one step at a time in turns.
//
// The next node of a ray is known only when the last one is done, and may then have to come from memory. Interleaving
// hides that latency: a ray's next node or leaf is prefetched as soon as it is known and visited a round later. Each
// ray does exactly the single-ray traversal, and nothing passes between rays, so hits are the same bits. Coherent rays
// are faster in packets: packet.h.
#pragma once

#include <cassert>
#include <new>
#include <type_traits>

#include "traverse/box_misses.h"
#include "traverse/packet.h"
#include "traverse/traversal.h"

namespace wive::WIVE_ISA {

// A ray in flight.
template <class Frame, class Query, class Counters>
struct alignas(64) Flight {
    Frame ray;
    Query query{};
    [[no_unique_address]] Counters counters;
    Stack::Top top;
    std::size_t index = 0;  // of the ray in its batch
    Stack stack;
};

template <Isa I, template <class> class Slabs, template <class> class Triangles, class Query, StepCounter Counters>
    requires Traversable<I, Slabs, Triangles, Query>
class InFlight {
    using Rays = RayBatch<typename I::Real>;
    using Hits = HitBatch<typename I::Real>;
    using AllPackets = Packets<I, Slabs, Triangles, Query>;

public:
    // Packets are used only if they give the same bits, and not by kernels that count the steps of each ray.
    using PacketsOrNone =
        std::conditional_t<std::is_same_v<Counters, NoCounters> && AllPackets::bit_exact, AllPackets, NoPackets>;
    using State = Flight<typename Triangles<I>::Frame, Query, Counters>;
    using Layout = typename Slabs<I>::Layout;
    using Corners = typename Layout::template Corners<I>;

    // scratch: room for as many states as rays are to be in flight, aligned to 64 bytes.
    [[gnu::always_inline]] InFlight(const BvhView& bvh, const Rays& rays, const Hits& hits, const RaySource& source,
                                    PacketsOrNone& packets, std::byte* scratch)
        : bvh_(bvh),
          rays_(rays),
          hits_(hits),
          source_(source),
          packets_(packets),
          misses_(bvh, rays),
          flights_(reinterpret_cast<State*>(scratch)) {}

    // Traces the rays of the source until it is empty.
    void trace(unsigned in_flight) {
        assert(in_flight > 1 && in_flight <= max_in_flight);
        for (unsigned i = 0; i < in_flight; ++i) {
            start_next_ray(*new (flights_ + i) State);
        }
        while (ends_.node != node_queue_ || ends_.leaf != leaf_queue_) {  // any ray is queued
            visit_nodes();
            test_leaves();
            finish_and_replace();
        }
    }

private:
    // The three loops are functions of their own: inlined into one function they would share its registers.

    // A block some of whose triangles a ray may hit.
    struct Candidate {
        State* flight;
        const typename Layout::Block* block;
        bool last_block;
        typename Triangles<I>::Found found;
    };

    // One past the last flight of each queue. Flights are queued by the kind of their next step, so that each kind has
    // a loop of its own without branches on the kind.
    struct QueueEnds {
        State **node, **leaf, **done;
    };

    // Starts the next ray that can hit anything, in the given flight; writes misses for the rays before it.
    [[gnu::noinline]] void start_next_ray(State& f) {
        for (;; ++next_) {
            bool misses = false;
            do {
                if (next_ == end_ && !refill(f)) return;
                misses = misses_.has(next_, end_);
            } while (!misses && packets_.trace_next(next_, end_));
            new (&f.query) Query{};  // in place: a temporary copied over would stall on its own stores
            f.counters = Counters{};
            if (!misses && f.ray.load(bvh_, rays_, next_)) break;
            f.query.write(hits_, next_, 1);
            f.counters.write(hits_, next_);
        }
        assert(f.ray.is_finite());
        f.index = next_++;
        new (&f.query) Query(start_query<Query>(f.ray, hits_, f.index));
        f.top = Stack::Top(f.stack);
        f.top.child() = inner_child(0);  // the root
        *ends_.node++ = &f;
    }

    // Takes more rays from the source. Returns false if there are none left, or if the flight got a ray of a split
    // packet instead: while there are such rays, no other ray is next.
    [[gnu::noinline]] bool refill(State& f) {
        if (packets_.has_split_rays()) {
            packets_.take_split_ray(f, next_);
            QueueEnds ends = ends_;
            enqueue(bvh_, f, true, true, ends);
            ends_ = ends;
            return false;
        }
        if (source_.take(next_, end_)) return true;
        end_ = next_;
        return false;
    }

    // Pops entries that lie behind the best hit (may_skip is false for the rest of a leaf, which is never skipped),
    // prefetches the new top and, if the flight is ready for its next step, appends it to the node, leaf or done queue.
    // Branch-free: the flight is written to all three queues, and the end of one of them moves.
    [[gnu::always_inline]] static void enqueue(const BvhView& bvh, State& f, bool may_skip, bool ready,
                                               QueueEnds& ends) {
        Stack::Top top = f.top;
        if constexpr (Query::in_order)
            while (may_skip & (top.distance() > f.query.interval.box_tmax())) top.move(-1);
        f.top = top;
        const std::uint32_t child = top.child();
        prefetch<Layout>(bvh, child);
        const bool inner = is_inner(child), end = child == end_of_stack;
        *ends.node = *ends.leaf = *ends.done = &f;
        ends.node += ready & inner;
        ends.leaf += ready & !inner & !end;
        ends.done += ready & end;
    }

    // Visits the nodes of a few flights, which takes no branches, then enqueues those flights, which mispredicts. Small
    // groups limit what a misprediction discards; enqueueing all flights at the end would prefetch too late.
    [[gnu::noinline]] void visit_nodes() {
        constexpr std::ptrdiff_t group_size = 8;
        const BvhView bvh = bvh_;
        State** const last = ends_.node;
        QueueEnds ends = {node_queue_, ends_.leaf, ends_.done};  // refilled from the front, behind the reading index
        for (State** i = node_queue_; i != last;) {
            State** const next = last - i < group_size ? last : i + group_size;
            for (State** j = i; j != next; ++j) {
                State& f = **j;
                Stack::Top top = f.top;
                f.counters.inner_node();
                visit<Query::in_order, I>(bvh.template node<Layout>(top.child()), Slabs<I>(f.ray),
                                          f.query.interval.box_tmax(), top);
                f.top = top;
            }
            for (; i != next; ++i) enqueue(bvh, **i, true, true, ends);
        }
        ends_ = ends;
        assert_queues_fit();
    }

    // Tests one block per flight. The rest of its leaf stays on top of the stack, so that the next block is prefetched
    // and tested a round later. First find() runs on all blocks; then solve() on the few blocks with a possible hit,
    // without a branch on whether there is one. Flights with an order are enqueued after that, because what they pop
    // depends, by a branch, on intervals that are known only then.
    [[gnu::noinline]] void test_leaves() {
        const BvhView bvh = bvh_;
        State** const last = ends_.leaf;
        QueueEnds ends = {ends_.node, leaf_queue_, ends_.done};
        Candidate* end = candidates_;
        for (State** i = leaf_queue_; i != last; ++i) {
            State& f = **i;
            Stack::Top top = f.top;
            const std::uint32_t child = top.child();
            assert(!is_inner(child) && child != end_of_stack);
            const auto& block = *bvh.template leaf<Layout>(child);
            const bool last_block = leaf_block_count(child) == 1;
            f.counters.block(block);
            if (last_block) f.counters.leaf();
            top.child() = without_first_block(child, block.units());  // meaningless, but popped, if it was the last
            top.move(-static_cast<std::ptrdiff_t>(last_block));
            *end = {&f, &block, last_block, Triangles<I>(f.ray).find(Corners(block))};
            const bool found = end->found.hit_mask != 0;
            end += found;
            f.top = top;
            enqueue(bvh, f, last_block, !found, ends);
        }
        for (const Candidate* c = candidates_; c != end; ++c) {
            State& f = *c->flight;
            const bool done = Triangles<I>(f.ray).solve(Corners(*c->block), c->found, f.query);
            f.top.move_to_end_if(done, f.stack);
            if (done && !c->last_block) f.counters.leaf();
            if constexpr (!Query::in_order) enqueue(bvh, f, c->last_block, true, ends);
        }
        if constexpr (Query::in_order)
            for (const Candidate* c = candidates_; c != end; ++c) enqueue(bvh, *c->flight, c->last_block, true, ends);
        ends_ = ends;
        assert_queues_fit();
    }

    [[gnu::always_inline]] void finish_and_replace() {
        State** const last = ends_.done;
        ends_.done = done_queue_;
        for (State** i = done_queue_; i != last; ++i) {
            State& f = **i;
            f.query.write(hits_, f.index, f.ray.unscale);
            f.counters.write(hits_, f.index);
            start_next_ray(f);
        }
    }

    [[gnu::always_inline]] void assert_queues_fit() const {
        assert(ends_.node - node_queue_ <= max_in_flight);
        assert(ends_.leaf - leaf_queue_ <= max_in_flight);
        assert(ends_.done - done_queue_ <= max_in_flight);
    }

    const BvhView bvh_;
    const Rays rays_;
    const Hits hits_;
    const RaySource source_;
    PacketsOrNone& packets_;
    std::conditional_t<std::is_same_v<Counters, NoCounters>, BoxMisses<I, Layout>, NoMisses> misses_;
    State* flights_;
    // One more than the flights, because entries are also written past the ends.
    State *node_queue_[max_in_flight + 1], *leaf_queue_[max_in_flight + 1], *done_queue_[max_in_flight + 1];
    Candidate candidates_[max_in_flight + 1];
    QueueEnds ends_ = {node_queue_, leaf_queue_, done_queue_};
    std::size_t next_ = 0, end_ = 0;  // rays of the source that this thread has taken and not yet started
};

// A kernel: traces the rays of a source with so many rays in flight, one by one if in_flight is 1. Checks the types
// that it is made of, each with a message of its own.
template <class I, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
void trace_batch(const BvhView& bvh, const RayBatch<typename I::Real>& rays, const HitBatch<typename I::Real>& hits,
                 const RaySource& source, unsigned in_flight, std::byte* scratch) {
    using Corners = typename Slabs<I>::Layout::template Corners<I>;
    static_assert(Isa<I>, "I lacks an operation of an instruction set, see Isa in traverse/concepts.h");
    static_assert(NodeLayout<typename Slabs<I>::Layout, I>, "Slabs<I>::Layout must be a NodeLayout, see concepts.h");
    static_assert(SlabTest<Slabs<I>, I>, "Slabs<I> must be a SlabTest, see traverse/concepts.h");
    static_assert(RayQuery<Query, typename I::Real>, "Query must be a RayQuery, see traverse/concepts.h");
    static_assert(TriangleTest<Triangles<I>, Corners, Query>, "Triangles<I> must be a TriangleTest, see concepts.h");
    static_assert(StepCounter<Counters>, "Counters must be StepCounters or NoCounters, see traverse/counters.h");
    if (in_flight <= 1) {
        trace_one_by_one<I, Slabs, Triangles, Query, Counters>(bvh, rays, hits, source);
    } else {
        using Flights = InFlight<I, Slabs, Triangles, typename Query::InFlight, Counters>;
        typename Flights::PacketsOrNone packets(bvh, rays, hits, in_flight);
        Flights(bvh, rays, hits, source, packets, scratch).trace(in_flight);
    }
}

}  // namespace wive::WIVE_ISA
