// The order in which a ray meets the children of a node: a fixed permutation for each of the eight sign octants.
#pragma once

#include <array>
#include <cstdint>

#include "core/layout.h"

namespace wive {

// treelet: a depth-first walk of the binary treelet that swaps sides where the ray is negative on the split axis
// (the paper's). diagonal: children sorted along the octant's diagonal. slots: children assigned to eight slots,
// visited by slot number xor octant. none: shuffled, the same for every octant; what having no order costs.
enum class ChildOrder { treelet, diagonal, slots, none };

// For each octant, slots from front to back, four bits each, the first in the lowest bits.
struct alignas(16) SlotSequences : std::array<std::uint32_t, 8> {};

// The sequence of a single slot, and of two treelets of which the ray meets `left` first where it is positive on
// the axis. left_count: how many slots the left treelet has.
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

// Slots sorted by their boxes' centres along each octant's diagonal.
SlotSequences sort_along_diagonals(const Node& node, int children);

// The order of Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
// section 3.2: each child has one of eight places, and a ray of octant o visits places 0 ^ o, 1 ^ o, ... 7 ^ o. There a
// child's place is where it stands in the node and the order costs no memory; here it is written out like any other, so
// that the same kernels follow it.
SlotSequences assign_places(const Node& node, int children);

// Slots in an order that has nothing to do with where they are. (By slot would be octant 0's own order.)
SlotSequences shuffle(const Node& node, int children);

// Writes the node's order row: lane i gets the i-th slot of every octant. Empty slots come last.
void write_order(Node& node, SlotSequences sequences, int children);

}  // namespace wive
