// Slot order for any-hit queries. Any-hit traversal ignores the order row and visits slots last to first, so the child
// most likely to give a cheap hit goes last. Closest-hit traversal follows the order row and does not depend on it.
#pragma once

#include <cstddef>
#include <vector>

#include "build/binary_tree.h"
#include "build/collapse.h"
#include "core/large_array.h"
#include "core/parallel.h"

namespace wive {

// The sum of the projected areas of any subtree's triangles, as a difference of two prefix sums over the references.
class ProjectedAreaPrefixSum {
public:
    ProjectedAreaPrefixSum() = default;
    ProjectedAreaPrefixSum(const BinaryTree& tree, Threads& threads);

    double of(const Subtree& tree) const { return before(tree.end) - before(tree.begin); }

private:
    // Short enough for sums in single precision: a leaf's area is a difference of two of them.
    static constexpr std::size_t chunk_size = 64;

    double before(std::size_t ref) const {
        return chunks_before_[ref / chunk_size] + static_cast<double>(in_chunk_before_[ref]);
    }

    LargeArray<float> in_chunk_before_;  // per reference: the sum over its chunk up to it
    std::vector<double> chunks_before_;  // per chunk: the sum over the chunks before it
};

// Sorts a treelet's slots by rising score and renumbers the slots in its order. The score is that of Ize and Hansen
// 2011, "RTSAH Traversal Order for Occlusion Rays": the part of the slot's box that its triangles cover, which is the
// probability that a ray through the box hits one, over the square root of their number, which estimates the time to
// find that hit.
void sort_slots_for_any_hit(const BinaryTree& tree, const ProjectedAreaPrefixSum& areas, Treelet& treelet);

}  // namespace wive
