// Counter-based random numbers: a pure function of pixel, sample, bounce and seed, so that a picture is the same on any
// number of threads and on any backend.
#pragma once

#include <array>
#include <cstdint>

namespace wive {

// PCG4D of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".
inline std::array<std::uint32_t, 4> pcg4d(std::uint32_t x, std::uint32_t y, std::uint32_t z, std::uint32_t w) {
    std::array<std::uint32_t, 4> v = {x, y, z, w};
    for (std::uint32_t& a : v) a = a * 1664525u + 1013904223u;
    const auto mix = [&] {
        v[0] += v[1] * v[3];
        v[1] += v[2] * v[0];
        v[2] += v[0] * v[1];
        v[3] += v[1] * v[2];
    };
    mix();
    for (std::uint32_t& a : v) a ^= a >> 16;
    mix();
    return v;
}

// A float in [0, 1) from the high 24 bits.
inline float to_unit(std::uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

}  // namespace wive
