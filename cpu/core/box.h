// An axis-aligned box for the builder, two four-wide vectors; the fourth lane is free for the owner's use.
#pragma once

#include <cstdint>
#include <limits>

namespace wive {

// GCC's and Clang's portable vectors: SSE on x86, NEON on Arm.
typedef float Float4v __attribute__((vector_size(16)));
typedef std::int32_t Int4v __attribute__((vector_size(16)));

inline Float4v minimum(Float4v a, Float4v b) { return a < b ? a : b; }
inline Float4v maximum(Float4v a, Float4v b) { return a > b ? a : b; }

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
    // Half the surface area, the probability measure of the surface area heuristic.
    float half_area() const {
        const Float4v d = hi - lo;
        return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    }
};

}  // namespace wive
