// Where the children of a node stand. Closest hits follow the order row and do not depend on it. Any-hit queries take
// children as they stand, the last first: those stand last that are likely to hold a hit, and soon.
#pragma once

#include <cstddef>
#include <vector>

#include "build/binary_tree.h"
#include "build/collapse.h"
#include "core/large_array.h"
#include "core/parallel.h"

namespace wive {

// Sums of the projected areas of a subtree's triangles, without visiting them.
class Coverage {
public:
    Coverage() = default;
    Coverage(const BinaryTree& tree, Threads& threads);

    double of(const Subtree& tree) const { return before(tree.end) - before(tree.begin); }

private:
    // Short, so that single precision will do within: what a leaf's triangles cover is a difference of two sums.
    static constexpr std::size_t chunk_size = 64;

    double before(std::size_t ref) const {
        return chunks_before_[ref / chunk_size] + static_cast<double>(in_chunk_before_[ref]);
    }

    LargeArray<float> in_chunk_before_;  // of the references before this one, in its chunk
    std::vector<double> chunks_before_;
};

// Moves the slots of a treelet to where they shall stand, and its order with them. A slot's worth is how much of its
// box its triangles cover, which is how likely a ray through the box hits one, over the square root of their number,
// which stands for the time to find out (after Ize and Hansen 2011, "RTSAH Traversal Order for Occlusion Rays").
void stand_for_any_hit(const BinaryTree& tree, const Coverage& coverage, Treelet& treelet);

}  // namespace wive
