#include "build/any_hit_order.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

namespace wive {
namespace {

constexpr std::size_t chunks_per_task = 64;

// The sequence backwards; unused places stay behind it.
std::uint32_t reversed(std::uint32_t sequence, int count) {
    sequence = (sequence & 0x0f0f0f0fu) << 4 | (sequence >> 4 & 0x0f0f0f0fu);
    sequence = (sequence & 0x00ff00ffu) << 8 | (sequence >> 8 & 0x00ff00ffu);
    sequence = sequence << 16 | sequence >> 16;
    return count == 0 ? 0 : sequence >> 4 * (node_width - count);
}

}  // namespace

Coverage::Coverage(const BinaryTree& tree, Threads& threads)
    : in_chunk_before_(tree.count + 1), chunks_before_(tree.count / chunk_size + 1) {
    parallel_chunks_scattered(chunks_before_.size(), chunks_per_task, threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t chunk = begin; chunk < end; ++chunk) {
            const std::size_t first = chunk * chunk_size, last = std::min<std::size_t>(first + chunk_size, tree.count);
            float sum = 0;
            for (std::size_t ref = first; ref < last; ++ref) {
                in_chunk_before_[ref] = sum;
                sum += tree.refs[ref].projected_area();
            }
            if (last == tree.count && last < first + chunk_size) in_chunk_before_[last] = sum;
            chunks_before_[chunk] = static_cast<double>(sum);
        }
    });
    double sum = 0;
    for (double& chunk : chunks_before_) {
        const double own = chunk;
        chunk = sum;
        sum += own;
    }
}

void stand_for_any_hit(const BinaryTree& tree, const Coverage& coverage, Treelet& treelet) {
    const auto count = static_cast<std::size_t>(treelet.count);
    // Squared, which ranks alike. Lanes without a slot rank behind all others.
    alignas(16) std::array<float, node_width> worth;
    worth.fill(std::numeric_limits<float>::infinity());
    for (std::size_t i = 0; i < count; ++i) {
        const Subtree& slot = treelet.slots[i].tree;
        const float area = tree.box_of(slot).half_area();
        const float covered = area > 0 ? static_cast<float>(coverage.of(slot)) / area : 0;
        worth[i] = std::min(covered * covered / static_cast<float>(slot.size()), std::numeric_limits<float>::max());
    }
    alignas(16) std::array<std::uint32_t, node_width> place{};
    for (std::size_t k = 0; k < node_width; ++k)
        for (std::size_t i = 0; i < node_width; ++i) place[i] += k < i ? worth[k] <= worth[i] : worth[k] < worth[i];
    const std::array<Slot, node_width> slots = treelet.slots;
    std::uint32_t places = 0;  // four bits each
    for (std::size_t i = 0; i < count; ++i) {
        treelet.slots[place[i]] = slots[i];
        places |= place[i] << 4 * i;
    }
    for (std::size_t octant = 0; octant < 4; ++octant) {
        const std::uint32_t sequence = treelet.order[octant];
        std::uint32_t moved = 0;
        for (std::size_t i = 0; i < count; ++i) moved |= (places >> 4 * (sequence >> 4 * i & 7u) & 7u) << 4 * i;
        treelet.order[octant] = moved;
        treelet.order[7 - octant] = reversed(moved, treelet.count);
    }
}

}  // namespace wive
