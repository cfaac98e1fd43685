// The builder's axis-aligned box: two four-lane vectors. Lane 3 is not part of the box; PrimRef keeps data in it.
#pragma once

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
    // Half the surface area. SAH takes the ratio of two boxes' areas as the probability that a ray through the outer
    // box meets the inner one.
    float half_area() const {
        const Float4v d = hi - lo;
        return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    }
};

}  // namespace wive
