// The slab test of one ray against the eight boxes of a node.
#pragma once

#include <cassert>

#include "core/layout.h"
#include "traverse/concepts.h"
#include "traverse/corners.h"
#include "traverse/frame.h"

namespace wive::WIVE_ISA {

// Which boxes are hit, and where the ray enters each.
template <class I>
struct BoxHits {
    typename I::Float8 tnear;
    typename I::Hits hit;
};

// Reads a row of planes for the test of eight boxes against one ray, or of one box against eight rays.
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

// What the octant of a ray decides, as in its frame but computed from the shift alone. A ray that has just been loaded
// starts sooner so: the compiler reads several rows of the frame at once, and such a load waits until the stores of
// single rows have left the processor's store buffer.
struct OctantRows {
    std::uint32_t near_row[3], far_row[3], order_shift;

    [[gnu::always_inline]] explicit OctantRows(unsigned shift) : order_shift(shift) {
        for (unsigned axis = 0; axis < 3; ++axis) {
            near_row[axis] = near_row_of(octant_of_order_shift(shift), axis);
            far_row[axis] = far_row_of(octant_of_order_shift(shift), axis);
        }
    }
};

// Nodes with float32 planes, and blocks that store each triangle's corners.
template <class Real>
struct Float32Layout {
    using Node = wive::Node;
    using Block = TriangleBlockOf<Real>;
    template <class I>
    using Corners = StoredCorners<I>;
    static constexpr unsigned prefetched_lines = sizeof(Real) == sizeof(float) ? 4 : 5;  // a node; a block of doubles
    static constexpr unsigned order_bits = 4;
    static constexpr bool boxes_are_nested = true;

    // plane * rdir + bias
    template <class Float8>
    [[gnu::always_inline]] static Float8 distance(const Node& node, auto children, std::size_t row, unsigned,
                                                  Float8 rdir, Float8 bias) {
        return multiply_add(children(planes_from(node, row)), rdir, bias);
    }
    // Empty lanes have boxes that nothing hits.
    template <class BoxHits>
    [[gnu::always_inline]] static BoxHits drop_empty_lanes(const Node&, BoxHits hits) {
        return hits;
    }
};

// The shift to an octant's bits in a lane of this layout's order row, from that of a frame.
template <class Layout>
[[gnu::always_inline]] constexpr unsigned order_shift_of(unsigned frame_shift) {
    assert(frame_shift % 4 == 0 && frame_shift / 4 < 8);  // one of eight octants
    return frame_shift * Layout::order_bits / 4;
}

// Entry and exit distances, clipped to [tmin, tmax]; a box is hit if entry <= exit. near(axis) and far(axis): distances
// to the planes on that axis that are met first and last, for eight boxes and one ray or for one box and eight rays.
template <Isa I>
[[gnu::always_inline]] inline BoxHits<I> intersect_boxes(const auto& near, const auto& far, typename I::Float8 tmin,
                                                         typename I::Float8 tmax) {
    const auto tnear = max(max(near(0u), near(1u)), max(near(2u), tmin));
    return {tnear, hits(tnear, min(min(far(0u), far(1u)), min(far(2u), tmax)))};
}

// The paper's full form: entry and exit distances in two registers of eight lanes.
template <Isa I, NodeLayout<I> L>
struct RaySlabs {
    using Layout = L;
    using Node = typename Layout::Node;
    using Float8 = typename I::Float8;

    Float8 rdir[3], near_bias[3], far_bias[3], tmin;
    std::size_t near_row[3], far_row[3];  // in planes from the node's first
    unsigned order_shift;

    [[gnu::always_inline]] explicit RaySlabs(const RayFrame<I>& ray) : RaySlabs(ray, ray) {}
    // octant: the ray's OctantRows, or a frame.
    [[gnu::always_inline]] RaySlabs(const RayFrame<I>& ray, const auto& octant)
        : tmin(Float8::all(ray.interval.box_tmin())) {
        for (unsigned axis = 0; axis < 3; ++axis) {
            rdir[axis] = Float8::all(ray.rdir[axis]);
            near_bias[axis] = Float8::all(ray.near_bias[axis]);
            far_bias[axis] = Float8::all(ray.far_bias[axis]);
            near_row[axis] = octant.near_row[axis];
            far_row[axis] = octant.far_row[axis];
        }
        order_shift = order_shift_of<Layout>(octant.order_shift);
    }

    [[gnu::always_inline]] typename I::Order order(const Node& node) const { return {node.order, order_shift}; }

    [[gnu::always_inline]] BoxHits<I> test(const Node& node, float tmax) const {
        constexpr AllChildren<Float8> children;
        return Layout::drop_empty_lanes(
            node, intersect_boxes<I>(
                      [&](unsigned axis) {
                          return Layout::distance(node, children, near_row[axis], axis, rdir[axis], near_bias[axis]);
                      },
                      [&](unsigned axis) {
                          return Layout::distance(node, children, far_row[axis], axis, rdir[axis], far_bias[axis]);
                      },
                      tmin, Float8::all(tmax)));
    }
};

template <class I>
using FullSlabs = RaySlabs<I, Float32Layout<typename I::Real>>;

}  // namespace wive::WIVE_ISA
