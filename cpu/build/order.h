// The order in which a ray meets the children of a node: a fixed permutation for each of the eight sign octants, by a
// depth-first walk of the binary treelet behind the node that swaps sides if the ray is negative on the split axis (the
// paper's). bench/native/study has others to compare it with.
#pragma once

#include <array>
#include <cstdint>

#include "core/layout.h"

namespace wive {

// For each octant, slots from front to back, four bits each, the first in the lowest bits.
struct alignas(16) SlotSequences : std::array<std::uint32_t, 8> {};

// The sequence of a single slot; and of two treelets, of which the ray meets `left` first if its direction is positive
// on the axis. left_count: how many slots the left treelet has.
constexpr SlotSequences single_slot(std::uint32_t slot) {
    SlotSequences s{};
    s.fill(slot);
    return s;
}
inline SlotSequences join(const SlotSequences& left, int left_count, const SlotSequences& right, int right_count,
                          int axis) {
    static constexpr std::uint32_t no = 0, yes = ~0u;
    alignas(16) static constexpr std::uint32_t is_negative[3][8] = {{no, yes, no, yes, no, yes, no, yes},
                                                                    {no, no, yes, yes, no, no, yes, yes},
                                                                    {no, no, no, no, yes, yes, yes, yes}};
    SlotSequences joined;
    for (std::size_t octant = 0; octant < 8; ++octant) {
        const std::uint32_t forwards = left[octant] | right[octant] << 4 * left_count;
        const std::uint32_t backwards = right[octant] | left[octant] << 4 * right_count;
        const std::uint32_t negative = is_negative[axis][octant];
        joined[octant] = (forwards & ~negative) | (backwards & negative);
    }
    return joined;
}

// Writes the node's order row: lane i gets the i-th slot of every octant. Empty slots come last.
void write_order(Node& node, SlotSequences sequences, int children);

}  // namespace wive
