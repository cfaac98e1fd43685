#include "build/any_hit_order.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <limits>

namespace wive {
namespace {

constexpr std::size_t chunks_per_task = 64;

// The sequence of the first `count` slots backwards; the places behind them are zero.
std::uint32_t reversed(std::uint32_t sequence, int count) {
    sequence = (sequence & 0x0f0f0f0fu) << 4 | (sequence >> 4 & 0x0f0f0f0fu);
    sequence = (sequence & 0x00ff00ffu) << 8 | (sequence >> 8 & 0x00ff00ffu);
    sequence = sequence << 16 | sequence >> 16;
    return count == 0 ? 0 : sequence >> order_bits * (node_width - count);
}

std::uint32_t slot_at(std::uint32_t sequence, std::size_t place) { return sequence >> order_bits * place & 7u; }

}  // namespace

ProjectedAreaPrefixSum::ProjectedAreaPrefixSum(const BinaryTree& tree, Threads& threads)
    : in_chunk_before_(tree.count + 1), chunks_before_(tree.count / chunk_size + 1) {
    const auto sum_chunks = [&](std::size_t begin, std::size_t end) {
        for (std::size_t chunk = begin; chunk < end; ++chunk) {
            const std::size_t first = chunk * chunk_size, last = std::min<std::size_t>(first + chunk_size, tree.count);
            float sum = 0;
            for (std::size_t ref = first; ref < last; ++ref) {
                in_chunk_before_[ref] = sum;
                sum += tree.refs[ref].projected_area() * tree.area_scale * tree.area_scale;
            }
            if (last == tree.count && last < first + chunk_size) in_chunk_before_[last] = sum;
            chunks_before_[chunk] = static_cast<double>(sum);
        }
    };
    const ProgressPart uncounted(0, 0);  // of emitting the tree
    parallel_chunks_scattered(chunks_before_.size(), chunks_per_task, threads, sum_chunks);
    double sum = 0;
    for (double& chunk : chunks_before_) {
        const double own = chunk;
        chunk = sum;
        sum += own;
    }
}

void sort_slots_for_any_hit(const BinaryTree& tree, const ProjectedAreaPrefixSum& areas, Treelet& treelet) {
    const auto count = static_cast<std::size_t>(treelet.count);
    // The bits of the squares of the scores, which sort alike. Compared as integers they are totally ordered whatever
    // the areas are, so that the places are a permutation. Lanes without a slot sort last.
    alignas(16) std::array<std::int32_t, node_width> score;
    score.fill(std::numeric_limits<std::int32_t>::max());
    for (std::size_t i = 0; i < count; ++i) {
        const Slot& slot = treelet.slots[i];
        const float area = slot.box.half_area(tree.area_scale);
        const float covered = area > 0 ? static_cast<float>(areas.of(slot.tree)) / area : 0;
        score[i] = std::bit_cast<std::int32_t>(covered * covered / static_cast<float>(slot.tree.size()));
    }
    alignas(16) std::array<std::uint32_t, node_width> place{};
    for (std::size_t k = 0; k < node_width; ++k)
        for (std::size_t i = 0; i < node_width; ++i) place[i] += k < i ? score[k] <= score[i] : score[k] < score[i];
    const std::array<Slot, node_width> slots = treelet.slots;
    std::uint32_t places = 0;  // place of every slot, order_bits each
    for (std::size_t i = 0; i < count; ++i) {
        treelet.slots[place[i]] = slots[i];
        places |= place[i] << order_bits * i;
    }
    for (std::size_t octant = 0; octant < octants / 2; ++octant) {
        const std::size_t opposite = octants - 1 - octant;
        const std::uint32_t sequence = treelet.order[octant];
        assert(treelet.order[opposite] == reversed(sequence, treelet.count));  // join() makes it so
        std::uint32_t renumbered = 0;
        for (std::size_t i = 0; i < count; ++i) renumbered |= slot_at(places, slot_at(sequence, i)) << order_bits * i;
        treelet.order[octant] = renumbered;
        treelet.order[opposite] = reversed(renumbered, treelet.count);
    }
}

}  // namespace wive
