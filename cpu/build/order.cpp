#include "build/order.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>

#include "core/random.h"

namespace wive {

namespace {

// The slots by rising key.
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

}  // namespace

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

void write_order(Node& node, SlotSequences sequences, int children) {
    for (int i = children; i < node_width; ++i)
        for (std::uint32_t& sequence : sequences) sequence |= static_cast<std::uint32_t>(i) << 4 * i;
    // Eight rows of eight nibbles, transposed: first the nibbles of two octants become bytes, those of even and of odd
    // lanes apart, then the bytes of four pairs a word.
    std::array<std::uint32_t, 4> even, odd;
    for (std::size_t pair = 0; pair < 4; ++pair) {
        const std::uint32_t a = sequences[2 * pair], b = sequences[2 * pair + 1];
        even[pair] = (a & 0x0f0f0f0fu) | (b & 0x0f0f0f0fu) << 4;
        odd[pair] = (a >> 4 & 0x0f0f0f0fu) | (b & 0xf0f0f0f0u);
    }
    const auto bytes = [](const std::array<std::uint32_t, 4>& words, int i) {
        const auto byte = [&](std::size_t pair) { return words[pair] >> 8 * i & 255u; };
        return byte(0) | byte(1) << 8 | byte(2) << 16 | byte(3) << 24;
    };
    for (int i = 0; i < node_width / 2; ++i) {
        node.order[2 * i] = bytes(even, i);
        node.order[2 * i + 1] = bytes(odd, i);
    }
}

}  // namespace wive
