// The slab test of one ray against the eight boxes of a compressed node.
#pragma once

#include "traverse/slabs.h"

namespace wive::WIVE_ISA {

struct CompressedPlanes {
    using Node = CompressedNode;
    static constexpr unsigned order_bits = 3;
    static constexpr bool boxes_are_nested = false;  // each is rounded by the steps of its own node

    // byte * (step * rdir) + (origin * rdir + bias)
    template <class Float8>
    [[gnu::always_inline]] static Float8 distance(const Node& node, auto children, std::size_t row, unsigned axis,
                                                  Float8 rdir, Float8 bias) {
        const Float8 origin = Float8::all(node.origin[axis]), step = Float8::all(node.step[axis]);
        return multiply_add(children(node.planes[0] + row), step * rdir, multiply_add(origin, rdir, bias));
    }
    template <class BoxHits>
    [[gnu::always_inline]] static BoxHits drop_empty_lanes(const Node& node, BoxHits hits) {
        return {hits.tnear, hits.hit.without(hits.hit.of_child(node.child, end_of_stack))};
    }
};

// Compressed nodes. So are blocks of floats, but not blocks of doubles.
template <class Real>
struct CompressedLayout;

template <>
struct CompressedLayout<double> : CompressedPlanes {
    using Block = TriangleBlockOf<double>;
    template <class I>
    using Corners = StoredCorners<I>;
    static constexpr unsigned prefetched_lines = Float32Layout<double>::prefetched_lines;
};

template <>
struct CompressedLayout<float> : CompressedPlanes {
    using Block = CompressedBlock;
    template <class I>
    using Corners = SharedCorners<I>;
    static constexpr unsigned prefetched_lines = 3;  // a block of either size wherever it begins; a node has two
};

template <class I>
using CompressedSlabs = RaySlabs<I, CompressedLayout<typename I::Real>>;

}  // namespace wive::WIVE_ISA
