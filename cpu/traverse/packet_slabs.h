// The slab test of all rays of a packet at once against the eight boxes of a node.
#pragma once

#include "traverse/slabs.h"

namespace wive::WIVE_ISA {

// Bounds of the reciprocals and origins of a packet's rays, which share the octant and with it rows and order.
struct PacketBounds {
    float rdir[2][3];                     // lowest and highest
    float near_origin[3], far_origin[3];  // from which near planes are met first, and far planes last
    float tmin;                           // lowest
    std::uint32_t near_row[3], far_row[3], order_shift;
};

// A ray with origin o and reciprocal r meets a plane p at (p - o) r. Over all rays of the packet this is least for the
// origin farthest ahead and for the lowest or the highest r, because it is linear in r. So the lesser of the two
// distances is no later than any ray's entry, and the greater of the two from the origin farthest behind is no sooner
// than any ray's exit. Rounding here is that of a single ray, so the slack of frame.h is enough for every hit that lies
// in its leaf's box. Other hits (concepts.h) depend on what each ray computes, whose slack and rounding add up to at
// most 23u M against 5u M for the two lines here: the origins are moved by 64u M then (packet.h).
template <Isa I, NodeLayout<I> L>
struct PacketSlabs {
    using Layout = L;
    using Node = typename Layout::Node;
    using Float8 = typename I::Float8;

    Float8 rdir[2][3], near_bias[2][3], far_bias[2][3], tmin;
    std::size_t near_row[3], far_row[3];
    unsigned order_shift;

    [[gnu::always_inline]] explicit PacketSlabs(const PacketBounds& rays) : tmin(Float8::all(rays.tmin)) {
        for (unsigned axis = 0; axis < 3; ++axis) {
            for (unsigned end = 0; end < 2; ++end) {
                const float r = rays.rdir[end][axis];
                rdir[end][axis] = Float8::all(r);
                near_bias[end][axis] = Float8::all(-rays.near_origin[axis] * r);
                far_bias[end][axis] = Float8::all(-rays.far_origin[axis] * r);
            }
            near_row[axis] = rays.near_row[axis];
            far_row[axis] = rays.far_row[axis];
        }
        order_shift = order_shift_of<Layout>(rays.order_shift);
    }

    [[gnu::always_inline]] typename I::Order order(const Node& node) const { return {node.order, order_shift}; }

    [[gnu::always_inline]] BoxHits<I> test(const Node& node, float tmax) const {
        constexpr AllChildren<Float8> children;
        const auto near = [&](unsigned axis, unsigned end) {
            return Layout::distance(node, children, near_row[axis], axis, rdir[end][axis], near_bias[end][axis]);
        };
        const auto far = [&](unsigned axis, unsigned end) {
            return Layout::distance(node, children, far_row[axis], axis, rdir[end][axis], far_bias[end][axis]);
        };
        return Layout::drop_empty_lanes(
            node, intersect_boxes<I>([&](unsigned axis) { return min(near(axis, 0), near(axis, 1)); },
                                     [&](unsigned axis) { return max(far(axis, 0), far(axis, 1)); }, tmin,
                                     Float8::all(tmax)));
    }
};

}  // namespace wive::WIVE_ISA
