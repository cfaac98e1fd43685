// Rays that miss the box around the whole tree, found four at a time before anything else is computed of them.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <limits>

#include "core/layout.h"
#include "core/ray.h"
#include "traverse/concepts.h"
#include "traverse/pauses.h"

namespace wive::WIVE_ISA {

// Boxes are enlarged here by box_slack (O + P), O and P the largest coordinates of the ray's origin and of the box,
// relative to the tree's centre: rounding and the triangle test (frame.h) add up to less than 20u (O + P). If O + P is
// below least_box_distance, that might underflow, and no ray is known to miss.
inline constexpr float box_slack = 0x1p-19f, least_box_distance = 0x1p-90f;

// Whether ray i starts outside of the tree's extent on an axis, leads away from it there and has no tmin before its
// origin. Planes of a compressed root lie outside of the extent, so that rays which leave the tree would visit nodes.
template <Isa I>
[[gnu::always_inline]] inline bool leads_away(const BvhView& bvh, const RayBatch<typename I::Real>& rays,
                                              std::size_t i) {
    using Real4 = typename I::Real4;
    using Float4 = typename I::Float4;
    const auto *o = rays.origins + 3 * i, *d = rays.directions + 3 * i;
    const Float4 extent = Float4::load(bvh.extent), center = Float4::load(bvh.center);
    const Float4 origin = Float4::narrow(Real4::set(o[0], o[1], o[2], 0) - Real4::of(center)), size = abs(origin);
    const unsigned outside = less(extent, size);
    if (outside == 0) return false;  // most rays, and what follows would cost them 3 %
    const float distance = highest_lane(size) + highest_lane(extent);
    const unsigned beyond_slack = less(extent + Float4::all(distance * box_slack), size);
    const unsigned towards = sign_bits(origin) ^ sign_bits(Float4::narrow(Real4::set(d[0], d[1], d[2], 0)));
    return (beyond_slack & ~towards) != 0 && distance >= least_box_distance && rays.tmin[i * rays.tmin_stride] >= 0;
}

// A ray from outside that misses costs as much as several nodes: it is loaded, queued and written. So blocks of rays
// are tested first, as long as some of them miss; then more and more rays are taken untested before the next block.
template <Isa I, NodeLayout<I> Layout>
class BoxMisses {
    using Real = typename I::Real;
    using Real4 = typename I::Real4;
    using Float4 = typename I::Float4;

public:
    BoxMisses(const BvhView& bvh, const RayBatch<Real>& rays) : bvh_(bvh), rays_(rays) {}

    // Whether ray i, before `end`, is known to miss. Rays are asked for in ascending order.
    [[gnu::always_inline]] bool has(std::size_t i, std::size_t end) {
        if (!pauses_.allow(i)) return false;
        if (i >= block_end_ && !test_block(i, end)) return false;
        return misses_ >> (i - (block_end_ - block_size)) & 1u;
    }

private:
    static constexpr unsigned block_size = 16;
    static constexpr int worthwhile_misses = 4;  // of a block

    [[gnu::noinline]] bool test_block(std::size_t first, std::size_t end) {
        if (end - first < block_size) return false;
        if (block_end_ == 0) find_box();
        misses_ = 0;
        for (unsigned i = 0; i < block_size; i += 4) misses_ |= misses_of_four(first + i) << i;
        block_end_ = first + block_size;
        if (std::popcount(misses_) >= worthwhile_misses)
            pauses_.worthwhile();
        else
            pauses_.in_vain(block_end_);
        return true;
    }

    // The box of the root's children, within the tree's extent: planes of compressed nodes may lie outside of it.
    // Without children its middle is NaN, by which no ray is known to miss.
    void find_box() {
        const auto& root = bvh_.template node<Layout>(inner_child(0));
        for (int axis = 0; axis < 3; ++axis) {
            double low = std::numeric_limits<double>::infinity(), high = -low;
            for (int lane = 0; lane < node_width; ++lane) {
                if (root.child[lane] == end_of_stack) continue;
                low = std::min(low, root.plane(low_row(axis), lane));
                high = std::max(high, root.plane(high_row(axis), lane));
            }
            const double extent = bvh_.extent[axis];
            low = std::max(low, -extent);
            high = std::min(high, extent);
            middle_[axis] = static_cast<float>(0.5 * (low + high));
            half_[axis] = static_cast<float>(0.5 * (high - low));
            largest_ = std::max({largest_, static_cast<float>(-low), static_cast<float>(high)});
        }
    }

    // The mask of those of rays [first, first + 4) that miss the box. Seen along an axis, the box is a rectangle and
    // the ray a line; if all corners of the rectangle lie on one side of the line, the ray misses. This takes no
    // division. A ray also misses if it starts outside of the box on an axis and leads away from it on that axis.
    // Components of the direction count as at least 2^-30 of the longest, so that underflow is less than the slack of
    // the box if the distance that it goes by and its product with the longest component are in range.
    unsigned misses_of_four(std::size_t first) const {
        constexpr float smallest_part = 0x1p-30f, most = 0x1p120f;
        const auto load = [](const Real* from, std::size_t stride) {
            return Real4::set(from[0], from[stride], from[2 * stride], from[3 * stride]);
        };
        const Real *origins = rays_.origins + 3 * first, *directions = rays_.directions + 3 * first;
        Float4 origin[3], direction[3], size[3], reach[3];
        Float4 distance = Float4::all(0), longest = distance;
        for (unsigned axis = 0; axis < 3; ++axis) {
            origin[axis] = Float4::narrow(load(origins + axis, 3) - Real4::all(Real{bvh_.center[axis]}));
            direction[axis] = Float4::narrow(load(directions + axis, 3));
            distance = max(distance, abs(origin[axis]));
            longest = max(longest, abs(direction[axis]));
        }
        distance = distance + Float4::all(largest_);
        for (unsigned axis = 0; axis < 3; ++axis) {
            origin[axis] = origin[axis] - Float4::all(middle_[axis]);
            size[axis] = max(abs(direction[axis]), longest * Float4::all(smallest_part));
            reach[axis] = Float4::all(half_[axis]) + distance * Float4::all(box_slack);
        }
        const std::size_t stride = rays_.tmin_stride;
        const unsigned ahead = less_equal(Real4::all(0), load(rays_.tmin + first * stride, stride));
        unsigned misses = 0;
        for (unsigned axis = 0; axis < 3; ++axis) {
            const unsigned a = (axis + 1) % 3, b = (axis + 2) % 3;
            misses |=
                less(size[a] * reach[b] + size[b] * reach[a], abs(origin[a] * direction[b] - origin[b] * direction[a]));
            misses |=
                ahead & less(reach[axis], abs(origin[axis])) & ~(sign_bits(origin[axis]) ^ sign_bits(direction[axis]));
        }
        const Float4 magnitude = distance * longest;
        misses &= less_equal(Float4::all(least_box_distance), min(distance, magnitude));
        return misses & less_equal(magnitude, Float4::all(most)) & 15u;
    }

    const BvhView bvh_;
    const RayBatch<Real> rays_;
    float middle_[3], half_[3], largest_ = 0;
    Pauses pauses_{block_size, block_size};
    std::size_t block_end_ = 0;
    unsigned misses_ = 0;  // of the block before block_end_
};

// For kernels that count the steps of each ray.
struct NoMisses {
    [[gnu::always_inline]] NoMisses(const BvhView&, const auto&) {}
    [[gnu::always_inline]] static bool has(std::size_t, std::size_t) { return false; }
};

}  // namespace wive::WIVE_ISA
