// The ray against a node's eight boxes.
#pragma once

#include "corners.h"
#include "frame.h"
#include "layout.h"

namespace wive {

// Where the ray enters each box, and which of them it meets.
template <class Isa>
struct Entries {
    typename Isa::Float8 tnear;
    typename Isa::Hits hit;
};

// The nodes and blocks that were not compressed, and the cache lines of a node, or of a block of doubles.
template <class Real>
struct Float32Form {
    using Node = wive::Node;
    using Block = TriangleBlockOf<Real>;
    template <class Isa>
    using Corners = StoredCorners<Isa>;
    static constexpr unsigned prefetched_lines = sizeof(Real) == sizeof(float) ? 4 : 5;
};

[[gnu::always_inline]] inline const float* row(const Node& node, std::size_t plane) {
    return reinterpret_cast<const float*>(&node) + plane;
}

// The paper's full form: entry and exit distances in two registers of eight lanes.
template <class Isa>
struct FullSlabs {
    using Form = Float32Form<typename Isa::Real>;
    using Float8 = typename Isa::Float8;

    Float8 rdir[3], near_bias[3], far_bias[3], tmin;
    std::size_t near_row[3], far_row[3];  // in planes from the node's first
    unsigned order_shift;

    [[gnu::always_inline]] explicit FullSlabs(const RayFrame<Isa>& ray) : tmin(Float8::all(ray.interval.entry())) {
        for (unsigned axis = 0; axis < 3; ++axis) {
            rdir[axis] = Float8::all(ray.rdir[axis]);
            near_bias[axis] = Float8::all(ray.near_bias[axis]);
            far_bias[axis] = Float8::all(ray.far_bias[axis]);
            near_row[axis] = ray.near_row[axis];
            far_row[axis] = ray.near_row[axis] ^ node_width;
        }
        // The stack wants the farthest child first, and octant 7 - o is octant o backwards.
        order_shift = 4 * (7 - ray.octant);
    }

    [[gnu::always_inline]] typename Isa::Order order(const Node& node) const { return {node.order, order_shift}; }

    // Entry and exit distances, cut to [tmin, tmax]; a child is hit where entry <= exit.
    [[gnu::always_inline]] Entries<Isa> test(const Node& node, float tmax) const {
        const auto near_plane = [&](unsigned axis) {
            return multiply_add(Float8::load(row(node, near_row[axis])), rdir[axis], near_bias[axis]);
        };
        const auto far_plane = [&](unsigned axis) {
            return multiply_add(Float8::load(row(node, far_row[axis])), rdir[axis], far_bias[axis]);
        };
        const Float8 tnear = max(max(near_plane(0), near_plane(1)), max(near_plane(2), tmin));
        return {tnear, hits(tnear, min(min(far_plane(0), far_plane(1)), min(far_plane(2), Float8::all(tmax))))};
    }
};

}  // namespace wive
