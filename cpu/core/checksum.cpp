#include "core/checksum.h"

#include <cstring>
#include <vector>

namespace wive {
namespace {

constexpr std::size_t chunk_bytes = std::size_t{1} << 20;
constexpr std::size_t lanes = 8, stripe_bytes = lanes * sizeof(std::uint64_t);
// The fractional digits of the golden ratio, odd: multiplying by it loses nothing.
constexpr std::uint64_t factor = 0x9e3779b97f4a7c15u;

// One-to-one in either argument if the other is fixed, so that no changed word is lost on the way.
constexpr std::uint64_t mixed(std::uint64_t state, std::uint64_t word) {
    const std::uint64_t product = (state ^ word) * factor;
    return product ^ product >> 29;
}

// Eight chains side by side, which multiply at once; then one chain of their ends and of the length.
std::uint64_t checksum_of_chunk(std::span<const std::byte> data) {
    std::uint64_t states[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) states[lane] = (lane + 1) * factor;
    const auto add_stripe = [&](const std::byte* stripe) {
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            std::uint64_t word;  // one by one: GCC would copy a whole stripe to memory and back
            std::memcpy(&word, stripe + sizeof(word) * lane, sizeof(word));
            states[lane] = mixed(states[lane], word);
        }
    };
    std::size_t at = 0;
    for (; at + stripe_bytes <= data.size(); at += stripe_bytes) add_stripe(data.data() + at);
    if (at < data.size()) {
        std::byte last[stripe_bytes] = {};
        std::memcpy(last, data.data() + at, data.size() - at);
        add_stripe(last);
    }
    std::uint64_t all = data.size();
    for (const std::uint64_t state : states) all = mixed(all, state);
    return all;
}

}  // namespace

std::uint64_t checksum(std::span<const std::byte> data, Threads& threads) {
    std::vector<std::uint64_t> chunks((data.size() + chunk_bytes - 1) / chunk_bytes);
    parallel_chunks(data.size(), chunk_bytes, threads, [&](std::size_t begin, std::size_t end) {
        chunks[begin / chunk_bytes] = checksum_of_chunk(data.subspan(begin, end - begin));
    });
    return checksum_of_chunk(std::as_bytes(std::span(chunks)));
}

}  // namespace wive
