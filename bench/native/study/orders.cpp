// Child orders to compare with that of the product (cpu/build/order.h), written over the order rows of a float32 tree.
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>

#include "build/order.h"
#include "core/layout.h"
#include "core/random.h"

namespace wive {

namespace {

// The slots by rising key. Each order below gives, for each octant, slots from front to back (cpu/build/order.h).
template <class Key>
std::uint32_t sort_slots(const std::array<Key, node_width>& key, int children) {
    std::array<std::uint32_t, node_width> slots;
    std::iota(slots.begin(), slots.end(), 0u);
    std::stable_sort(slots.begin(), slots.begin() + children,
                     [&](std::uint32_t a, std::uint32_t b) { return key[a] < key[b]; });
    std::uint32_t sequence = 0;
    for (int i = 0; i < children; ++i) sequence |= slots[static_cast<std::size_t>(i)] << 4 * i;
    return sequence;
}

// Slots sorted by their boxes' centres along each octant's diagonal.
SlotSequences sort_along_diagonals(const Node& node, int children) {
    SlotSequences sequences;
    for (unsigned octant = 0; octant < 8; ++octant) {
        std::array<float, node_width> key{};
        for (int i = 0; i < children; ++i)
            for (int axis = 0; axis < 3; ++axis) {
                const float centre = node.planes[2 * axis][i] + node.planes[2 * axis + 1][i];
                key[static_cast<std::size_t>(i)] += (octant >> axis & 1u) ? -centre : centre;
            }
        sequences[octant] = sort_slots(key, children);
    }
    return sequences;
}

// The order of Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
// section 3.2: each child has one of eight places, and a ray of octant o visits places 0 ^ o, 1 ^ o, ... 7 ^ o. There a
// child's place is its lane in the node and the order costs no memory; here it is written out like any other, so that
// the same kernels follow it.
SlotSequences assign_places(const Node& node, int children) {
    // cost[i][s]: how far child i lies along the diagonal on which place s is met first. The node's own centre would
    // move all costs of a child set alike, and so no assignment.
    std::array<std::array<float, node_width>, node_width> cost{};
    for (unsigned i = 0; i < static_cast<unsigned>(children); ++i)
        for (unsigned place = 0; place < node_width; ++place)
            for (unsigned axis = 0; axis < 3; ++axis) {
                const float centre = node.planes[2 * axis][i] + node.planes[2 * axis + 1][i];
                cost[i][place] += (place >> axis & 1u) ? -centre : centre;
            }
    // The cheapest assignment, exactly (the paper's auction comes near it): least[used] is the least cost of giving the
    // first children the places in the set `used`, as many as there are.
    std::array<float, 1u << node_width> least;
    std::array<unsigned, 1u << node_width> last_place;
    least.fill(std::numeric_limits<float>::infinity());
    least[0] = 0;
    unsigned cheapest = 0;
    float cheapest_cost = std::numeric_limits<float>::infinity();
    for (unsigned used = 0; used < least.size(); ++used) {
        const auto child = static_cast<unsigned>(std::popcount(used));
        if (child == static_cast<unsigned>(children)) {
            if (least[used] < cheapest_cost) {
                cheapest_cost = least[used];
                cheapest = used;
            }
            continue;
        }
        if (child > static_cast<unsigned>(children)) continue;
        for (unsigned place = 0; place < node_width; ++place) {
            const unsigned next = used | 1u << place;
            const float sum = least[used] + cost[child][place];
            if (next != used && sum < least[next]) {
                least[next] = sum;
                last_place[next] = place;
            }
        }
    }
    std::array<unsigned, node_width> place_of{};
    for (unsigned used = cheapest, child = static_cast<unsigned>(children); child-- > 0; used ^= 1u << last_place[used])
        place_of[child] = last_place[used];
    SlotSequences sequences;
    for (unsigned octant = 0; octant < 8; ++octant) {
        std::array<unsigned, node_width> key{};
        for (std::size_t i = 0; i < node_width; ++i) key[i] = place_of[i] ^ octant;
        sequences[octant] = sort_slots(key, children);
    }
    return sequences;
}

// Slots in an order that has nothing to do with where they are. (By slot would be octant 0's own order.)
SlotSequences shuffle(const Node& node, int children) {
    std::array<std::uint32_t, node_width> key{};
    for (int i = 0; i < children; ++i) {
        const auto bits = [&](int row) { return std::bit_cast<std::uint32_t>(node.planes[row][i]); };
        key[static_cast<std::size_t>(i)] = pcg4d(bits(0), bits(2), bits(4), static_cast<std::uint32_t>(i))[0];
    }
    SlotSequences sequences;
    sequences.fill(sort_slots(key, children));
    return sequences;
}

// Lanes with a child: they come first, and the others hold an inverted box.
int child_count(const Node& node) {
    int count = 0;
    while (count < node_width && node.planes[0][count] <= node.planes[1][count]) ++count;
    return count;
}

}  // namespace
}  // namespace wive

extern "C" void study_write_order(wive::Node* nodes, std::size_t count, int order) {
    using namespace wive;
    SlotSequences (*const orders[])(const Node&, int) = {sort_along_diagonals, assign_places, shuffle};
    for (std::size_t i = 0; i < count; ++i) {
        const int children = child_count(nodes[i]);
        write_order(nodes[i], orders[order](nodes[i], children), children);
    }
}
