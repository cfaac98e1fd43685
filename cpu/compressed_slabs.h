// The ray against the eight boxes of a compressed node.
#pragma once

#include "slabs.h"

namespace wive {

// Two cache lines hold a node, three a block of either size wherever it begins. Blocks of doubles are not compressed.
template <class Real>
struct CompressedForm;

template <>
struct CompressedForm<double> : Float32Form<double> {
    using Node = CompressedNode;
};

template <>
struct CompressedForm<float> {
    using Node = CompressedNode;
    using Block = CompressedBlock;
    template <class Isa>
    using Corners = SharedCorners<Isa>;
    static constexpr unsigned prefetched_lines = 3;
};

// As FullSlabs; the distance to a plane is byte * (step * rdir) + (origin * rdir + bias).
template <class Isa>
struct CompressedSlabs {
    using Form = CompressedForm<typename Isa::Real>;
    using Float8 = typename Isa::Float8;

    Float8 rdir[3], near_bias[3], far_bias[3], tmin;
    std::size_t near_row[3], far_row[3];  // in planes, which are bytes, from the node's first
    unsigned order_shift;

    [[gnu::always_inline]] explicit CompressedSlabs(const RayFrame<Isa>& ray) : tmin(Float8::all(ray.interval.entry())) {
        for (unsigned axis = 0; axis < 3; ++axis) {
            rdir[axis] = Float8::all(ray.rdir[axis]);
            near_bias[axis] = Float8::all(ray.near_bias[axis]);
            far_bias[axis] = Float8::all(ray.far_bias[axis]);
            near_row[axis] = ray.near_row[axis];
            far_row[axis] = ray.near_row[axis] ^ node_width;
        }
        order_shift = 3 * (7 - ray.octant);
    }

    [[gnu::always_inline]] typename Isa::Order order(const CompressedNode& node) const { return {node.order, order_shift}; }

    [[gnu::always_inline]] Entries<Isa> test(const CompressedNode& node, float tmax) const {
        const std::uint8_t* planes = node.planes[0];
        Float8 near_plane[3], far_plane[3];
        for (unsigned axis = 0; axis < 3; ++axis) {
            const Float8 origin = Float8::all(node.origin[axis]), step = Float8::all(node.step[axis]) * rdir[axis];
            near_plane[axis] = multiply_add(Float8::load(planes + near_row[axis]), step,
                                            multiply_add(origin, rdir[axis], near_bias[axis]));
            far_plane[axis] = multiply_add(Float8::load(planes + far_row[axis]), step,
                                           multiply_add(origin, rdir[axis], far_bias[axis]));
        }
        const Float8 tnear = max(max(near_plane[0], near_plane[1]), max(near_plane[2], tmin));
        const Float8 tfar = min(min(far_plane[0], far_plane[1]), min(far_plane[2], Float8::all(tmax)));
        return {tnear, with_child(hits(tnear, tfar), node.child)};
    }
};

}  // namespace wive
