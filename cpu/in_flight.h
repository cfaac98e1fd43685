// Many rays in flight on one thread: each does exactly the single-ray traversal, one step at a time in turns.
//
// One ray's next node is known only when its last is done, and then it may have to come from memory. Here the others
// take their turns meanwhile: a ray's next node or leaf is prefetched when it becomes known and visited a round later.
// Hits are those of the single ray, bit for bit: nothing passes between rays.
#pragma once

#include <new>

#include "traversal.h"

namespace wive {

template <class Isa, class Query, class Counters>
struct alignas(64) Flight {
    RayFrame<Isa> ray;
    Query query{0, 0};
    Counters counters;
    Stack::Top top;
    std::size_t index = 0;  // of the ray in its batch
    Stack stack;
};

// Flights that wait for the same kind of step, so that each kind has a loop to itself and no step has to ask.
template <class State>
struct Waiting {
    State* flights[max_in_flight];
    unsigned count = 0;

    // Writes always, counts only if it is so: no branch.
    [[gnu::always_inline]] void add_if(bool condition, State* flight) {
        flights[count] = flight;
        count += condition;
    }
};

template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
class InFlight {
public:
    using State = Flight<Isa, Query, Counters>;
    using Form = typename Slabs<Isa>::Form;
    using Corners = typename Form::template Corners<Isa>;

    [[gnu::always_inline]] InFlight(const BvhView& bvh, const RayBatch& rays, const HitBatch& hits,
                                    const RaySource& source, std::byte* scratch)
        : bvh_(bvh), rays_(rays), hits_(hits), source_(source), flights_(reinterpret_cast<State*>(scratch)) {}

    void trace(unsigned in_flight) {
        for (unsigned i = 0; i < in_flight; ++i) {
            start(*new (flights_ + i) State);
        }
        while (at_node_.count + at_leaf_.count > 0) {
            visit_nodes();
            test_leaves();
            finish_and_replace();
        }
    }

private:
    // Puts the next ray that can hit anything into a flight's place; rays that can't are answered here.
    void start(State& f) {
        for (;; ++next_) {
            if (next_ == end_ && !source_.take(next_, end_)) {
                end_ = next_;
                return;
            }
            f.query = Query{0, 0};
            f.counters = Counters{};
            if (f.ray.load(bvh_, rays_, next_)) break;
            f.query.write(hits_, next_, 1);
            f.counters.write(hits_, next_);
        }
        f.index = next_++;
        f.query = Query{f.ray.tmin, f.ray.tmax};
        f.top = Stack::Top(f.stack);
        f.top.child() = inner_child(0);  // the root
        at_node_.add_if(true, &f);
    }

    // The child on top is next: prefetched now, and waited for in the right place.
    [[gnu::always_inline]] void wait(State& f) {
        if constexpr (Query::in_order)
            while (f.top.distance() > f.query.tmax) f.top.move(-1);
        const std::uint32_t child = f.top.child();
        prefetch<Form>(bvh_, child);
        const bool inner = is_inner(child), end = child == end_of_stack;
        at_node_.add_if(inner, &f);
        at_leaf_.add_if(!inner & !end, &f);
        done_.add_if(end, &f);
    }

    [[gnu::always_inline]] void visit_nodes() {
        const unsigned count = at_node_.count;
        at_node_.count = 0;  // refilled from the front, never past the flight at hand
        for (unsigned i = 0; i < count; ++i) {
            State& f = *at_node_.flights[i];
            f.counters.inner_node();
            visit<Query::in_order>(bvh_.template node<Form>(f.top.child()), Slabs<Isa>(f.ray), f.query.tmax, f.top);
            wait(f);
        }
    }

    [[gnu::always_inline]] void test_leaves() {
        const unsigned count = at_leaf_.count;
        at_leaf_.count = 0;
        for (unsigned i = 0; i < count; ++i) {
            State& f = *at_leaf_.flights[i];
            const std::uint32_t child = f.top.child();
            f.counters.leaf();
            const auto* blocks = bvh_.template leaf<Form>(child);
            const bool finished =
                test_leaf<Corners>(blocks, leaf_block_count(child), Triangles<Isa>(f.ray), f.query, f.counters);
            if (finished) f.top = Stack::Top(f.stack);
            f.top.move(-1);
            wait(f);
        }
    }

    [[gnu::always_inline]] void finish_and_replace() {
        for (unsigned i = 0; i < done_.count; ++i) {
            State& f = *done_.flights[i];
            f.query.write(hits_, f.index, f.ray.scale);
            f.counters.write(hits_, f.index);
            start(f);
        }
        done_.count = 0;
    }

    const BvhView bvh_;
    const RayBatch rays_;
    const HitBatch hits_;
    const RaySource source_;
    State* flights_;
    Waiting<State> at_node_, at_leaf_, done_;
    std::size_t next_ = 0, end_ = 0;
};

template <class Isa, template <class> class Slabs, template <class> class Triangles, class Query, class Counters>
void trace_batch(const BvhView& bvh, const RayBatch& rays, const HitBatch& hits, const RaySource& source,
                 unsigned in_flight, std::byte* scratch) {
    if (in_flight <= 1)
        trace_one_by_one<Isa, Slabs, Triangles, Query, Counters>(bvh, rays, hits, source);
    else
        InFlight<Isa, Slabs, Triangles, Query, Counters>(bvh, rays, hits, source, scratch).trace(in_flight);
}

}  // namespace wive
