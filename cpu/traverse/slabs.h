// The ray against a node's eight boxes.
#pragma once

#include "core/layout.h"
#include "traverse/corners.h"
#include "traverse/frame.h"

namespace wive {

// Where the ray enters each box, and which of them it meets.
template <class Isa>
struct BoxHits {
    typename Isa::Float8 tnear;
    typename Isa::Hits hit;
};

// Planes of a node's eight boxes, or of one of them: eight children and a ray, or one child and eight rays.
template <class Float8>
struct AllChildren {
    [[gnu::always_inline]] Float8 operator()(const auto* row) const { return Float8::load(row); }
};
template <class Float8>
struct OneChild {
    unsigned lane;
    [[gnu::always_inline]] Float8 operator()(const auto* row) const {
        return Float8::all(static_cast<float>(row[lane]));
    }
};

[[gnu::always_inline]] inline const float* planes_from(const Node& node, std::size_t plane) {
    return reinterpret_cast<const float*>(&node) + plane;
}

// The nodes and blocks that were not compressed, and the cache lines of a node, or of a block of doubles.
template <class Real>
struct Float32Layout {
    using Node = wive::Node;
    using Block = TriangleBlockOf<Real>;
    template <class Isa>
    using Corners = StoredCorners<Isa>;
    static constexpr unsigned prefetched_lines = sizeof(Real) == sizeof(float) ? 4 : 5;
    static constexpr unsigned order_bits = 4;       // a sequence
    static constexpr bool boxes_are_nested = true;  // each in its parent's

    // Along a ray to the planes that stand in this row: plane * rdir + bias.
    template <class Float8>
    [[gnu::always_inline]] static Float8 distance(const Node& node, auto children, std::size_t row, unsigned,
                                                  Float8 rdir, Float8 bias) {
        return multiply_add(children(planes_from(node, row)), rdir, bias);
    }
    // Without the lanes that have no child.
    template <class BoxHits>
    [[gnu::always_inline]] static BoxHits of_children(const Node&, BoxHits entries) {
        return entries;
    }
};

// A frame counts in four bits a sequence.
template <class Layout>
[[gnu::always_inline]] constexpr unsigned order_shift_of(unsigned shift) {
    return shift * Layout::order_bits / 4;
}

// Entry and exit distances, cut to [tmin, tmax]; a child is hit where entry <= exit. Near and far say where an axis'
// planes are met, of a node's children or, for as many rays, of one child.
template <class Isa>
[[gnu::always_inline]] inline BoxHits<Isa> intersect_boxes(const auto& near, const auto& far, typename Isa::Float8 tmin,
                                                           typename Isa::Float8 tmax) {
    const auto tnear = max(max(near(0u), near(1u)), max(near(2u), tmin));
    return {tnear, hits(tnear, min(min(far(0u), far(1u)), min(far(2u), tmax)))};
}

// The paper's full form: entry and exit distances in two registers of eight lanes.
template <class Isa, class NodesAndBlocks>
struct RaySlabs {
    using Layout = NodesAndBlocks;
    using Node = typename Layout::Node;
    using Float8 = typename Isa::Float8;

    Float8 rdir[3], near_bias[3], far_bias[3], tmin;
    std::size_t near_row[3], far_row[3];  // in planes from the node's first
    unsigned order_shift;

    [[gnu::always_inline]] explicit RaySlabs(const RayFrame<Isa>& ray) : tmin(Float8::all(ray.interval.box_tmin())) {
        for (unsigned axis = 0; axis < 3; ++axis) {
            rdir[axis] = Float8::all(ray.rdir[axis]);
            near_bias[axis] = Float8::all(ray.near_bias[axis]);
            far_bias[axis] = Float8::all(ray.far_bias[axis]);
            near_row[axis] = ray.near_row[axis];
            far_row[axis] = ray.far_row[axis];
        }
        order_shift = order_shift_of<Layout>(ray.order_shift);
    }

    [[gnu::always_inline]] typename Isa::Order order(const Node& node) const { return {node.order, order_shift}; }

    [[gnu::always_inline]] BoxHits<Isa> test(const Node& node, float tmax) const {
        constexpr AllChildren<Float8> children;
        return Layout::of_children(
            node, intersect_boxes<Isa>(
                      [&](unsigned axis) {
                          return Layout::distance(node, children, near_row[axis], axis, rdir[axis], near_bias[axis]);
                      },
                      [&](unsigned axis) {
                          return Layout::distance(node, children, far_row[axis], axis, rdir[axis], far_bias[axis]);
                      },
                      tmin, Float8::all(tmax)));
    }
};

template <class Isa>
using FullSlabs = RaySlabs<Isa, Float32Layout<typename Isa::Real>>;

}  // namespace wive
