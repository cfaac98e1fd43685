// All rays of a packet at once against a node's eight boxes.
#pragma once

#include "traverse/slabs.h"

namespace wive {

// Between what the reciprocals and the origins of a packet's rays lie. They share the octant, and with it rows and
// order.
struct PacketBounds {
    float rdir[2][3];                 // lowest and highest
    float near_from[3], far_from[3];  // from where near planes and far planes are met first and last
    float tmin;                       // lowest
    std::uint32_t near_row[3], far_row[3], order_shift;
};

// A ray with origin o and reciprocal r meets a plane p at (p - o) r. Over all rays of the packet this is least for the
// origin farthest ahead, and for the lowest or the highest r, because it is linear in r: the lesser of the two is
// no later than any ray enters, and the greater of the two, from the origin farthest behind, no sooner than any leaves.
// That holds for what the rays compute (frame.h): their slack and rounding add up to 23u M at most, those of the two
// lines here to 5u M, and the origins are moved by 64u M (packet.h).
template <class Isa, class NodesAndBlocks>
struct PacketSlabs {
    using Layout = NodesAndBlocks;
    using Node = typename Layout::Node;
    using Float8 = typename Isa::Float8;

    Float8 rdir[2][3], near_bias[2][3], far_bias[2][3], tmin;
    std::size_t near_row[3], far_row[3];
    unsigned order_shift;

    [[gnu::always_inline]] explicit PacketSlabs(const PacketBounds& rays) : tmin(Float8::all(rays.tmin)) {
        for (unsigned axis = 0; axis < 3; ++axis) {
            for (unsigned end = 0; end < 2; ++end) {
                const float r = rays.rdir[end][axis];
                rdir[end][axis] = Float8::all(r);
                near_bias[end][axis] = Float8::all(-rays.near_from[axis] * r);
                far_bias[end][axis] = Float8::all(-rays.far_from[axis] * r);
            }
            near_row[axis] = rays.near_row[axis];
            far_row[axis] = rays.far_row[axis];
        }
        order_shift = order_shift_of<Layout>(rays.order_shift);
    }

    [[gnu::always_inline]] typename Isa::Order order(const Node& node) const { return {node.order, order_shift}; }

    [[gnu::always_inline]] BoxHits<Isa> test(const Node& node, float tmax) const {
        constexpr AllChildren<Float8> children;
        const auto near = [&](unsigned axis, unsigned end) {
            return Layout::distance(node, children, near_row[axis], axis, rdir[end][axis], near_bias[end][axis]);
        };
        const auto far = [&](unsigned axis, unsigned end) {
            return Layout::distance(node, children, far_row[axis], axis, rdir[end][axis], far_bias[end][axis]);
        };
        return Layout::of_children(
            node, intersect_boxes<Isa>([&](unsigned axis) { return min(near(axis, 0), near(axis, 1)); },
                                       [&](unsigned axis) { return max(far(axis, 0), far(axis, 1)); }, tmin,
                                       Float8::all(tmax)));
    }
};

}  // namespace wive
