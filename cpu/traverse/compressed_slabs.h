// The ray against the eight boxes of a compressed node.
#pragma once

#include "traverse/slabs.h"

namespace wive {

// The distance to a plane is byte * (step * rdir) + (origin * rdir + bias).
struct CompressedPlanes {
    using Node = CompressedNode;
    static constexpr unsigned order_bits = 3;
    static constexpr bool boxes_are_nested = false;  // each is rounded by the steps of its own node

    template <class Float8>
    [[gnu::always_inline]] static Float8 distance(const Node& node, auto children, std::size_t row, unsigned axis,
                                                  Float8 rdir, Float8 bias) {
        const Float8 origin = Float8::all(node.origin[axis]), step = Float8::all(node.step[axis]);
        return multiply_add(children(node.planes[0] + row), step * rdir, multiply_add(origin, rdir, bias));
    }
    template <class BoxHits>
    [[gnu::always_inline]] static BoxHits of_children(const Node& node, BoxHits entries) {
        return {entries.tnear, entries.hit.without(entries.hit.of_child(node.child, end_of_stack))};
    }
};

// Two cache lines hold a node, three a block of either size wherever it begins. Blocks of doubles are not compressed.
template <class Real>
struct CompressedLayout;

template <>
struct CompressedLayout<double> : CompressedPlanes {
    using Block = TriangleBlockOf<double>;
    template <class Isa>
    using Corners = StoredCorners<Isa>;
    static constexpr unsigned prefetched_lines = Float32Layout<double>::prefetched_lines;
};

template <>
struct CompressedLayout<float> : CompressedPlanes {
    using Block = CompressedBlock;
    template <class Isa>
    using Corners = SharedCorners<Isa>;
    static constexpr unsigned prefetched_lines = 3;
};

template <class Isa>
using CompressedSlabs = RaySlabs<Isa, CompressedLayout<typename Isa::Real>>;

}  // namespace wive
