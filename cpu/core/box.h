// The builder's axis-aligned box: two four-lane vectors. Lane 3 is not part of the box; PrimRef keeps data in it.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

namespace wive {

// Portable vectors of GCC and Clang: SSE on x86, NEON on Arm.
typedef float Float4v __attribute__((vector_size(16)));
typedef std::int32_t Int4v __attribute__((vector_size(16)));

inline Float4v minimum(Float4v a, Float4v b) { return a < b ? a : b; }
inline Float4v maximum(Float4v a, Float4v b) { return a > b ? a : b; }

// Empty until grown: lo is infinity and hi is -infinity.
struct Box {
    Float4v lo = Float4v{} + std::numeric_limits<float>::infinity();
    Float4v hi = Float4v{} - std::numeric_limits<float>::infinity();

    void grow(const Box& other) {
        lo = minimum(lo, other.lo);
        hi = maximum(hi, other.hi);
    }
    void grow(Float4v point) {
        lo = minimum(lo, point);
        hi = maximum(hi, point);
    }
    // Half the surface area of the box scaled by `scale` (area_scale). SAH takes the ratio of two boxes' areas as the
    // probability that a ray through the outer box meets the inner one.
    float half_area(float scale) const {
        const Float4v extent = hi - lo;
        // Lane 3 repeats lane 2: a box's own lane 3 may hold denormals, which are slow.
        const Float4v d = __builtin_shufflevector(extent, extent, 0, 1, 2, 2) * scale;
        return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    }
};

// A power of two that scales the longest side of a box to about 2^40. Areas of boxes inside it, times any number of
// triangles, are then finite, so no cost is infinite or NaN; and areas do not vanish in a small mesh, nor for details
// of 1e-30 of its size. Scaling by a power of two changes no comparison of areas that neither under- nor overflow.
inline float area_scale(const Box& box) {
    constexpr int mantissa = 23, one = 127, longest_side = 40, largest = 254;
    const Float4v extent = box.hi - box.lo;
    const float longest =
        std::max({static_cast<float>(extent[0]), static_cast<float>(extent[1]), static_cast<float>(extent[2]), 0.0f});
    const int exponent = static_cast<int>(std::bit_cast<std::uint32_t>(longest) >> mantissa);
    const int field = std::clamp(2 * one + longest_side - exponent, 1, largest);
    return std::bit_cast<float>(static_cast<std::uint32_t>(field) << mantissa);
}

}  // namespace wive
