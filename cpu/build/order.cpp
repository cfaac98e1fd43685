#include "build/order.h"

namespace wive {

void write_order(Node& node, SlotSequences sequences, int children) {
    for (int i = children; i < node_width; ++i)
        for (std::uint32_t& sequence : sequences) sequence |= static_cast<std::uint32_t>(i) << 4 * i;
    // Eight rows of eight nibbles, transposed in two steps: the nibbles of two octants become bytes, even and odd lanes
    // apart; then the bytes of four pairs become words.
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
