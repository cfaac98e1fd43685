// The corners of a block's four triangles as vectors: what triangle tests read, whatever layout the block has.
#pragma once

#include "core/compressed.h"
#include "core/layout.h"
#include "traverse/concepts.h"

namespace wive::WIVE_ISA {

// Corners of a block that stores all of them; in a `fast` tree the rows of the second and third vertex hold the edges
// from the first.
template <Isa I>
struct StoredCorners {
    using Real4 = typename I::Real4;
    using Block = TriangleBlockOf<typename I::Real>;

    const Block& block;

    [[gnu::always_inline]] explicit StoredCorners(const Block& stored) : block(stored) {}
    [[gnu::always_inline]] Real4 vertex(std::size_t k, std::size_t axis) const {
        return Real4::load(block.rows[3 * k + axis]);
    }
    // In `fast` trees: the edge from vertex 0, v0, to vertex k.
    [[gnu::always_inline]] Real4 edge(std::size_t k, std::size_t axis, Real4) const { return vertex(k, axis); }
    // The lanes of a hit mask that hold a triangle: all, because the NaN in unused lanes passes no test.
    [[gnu::always_inline]] unsigned used(unsigned hit_mask) const { return hit_mask; }
};

// Corners of a block whose triangles share their vertices.
template <Isa I>
struct SharedCorners {
    using Float4 = typename I::Float4;
    using Block = CompressedBlock;

    const Block& block;
    typename I::Pick pick[3];

    [[gnu::always_inline]] explicit SharedCorners(const Block& shared)
        : block(shared), pick{{shared.corners[0], 0}, {shared.corners[0], 16}, {shared.corners[1], 0}} {
        // Where rows begin is known only once the header has arrived, but the next cache line is needed in any case.
        __builtin_prefetch(reinterpret_cast<const std::byte*>(&shared) + 64);
    }
    [[gnu::always_inline]] Float4 vertex(std::size_t k, std::size_t axis) const { return pick[k](block.row(axis)); }
    [[gnu::always_inline]] Float4 edge(std::size_t k, std::size_t axis, Float4 v0) const {
        return vertex(k, axis) - v0;
    }
    [[gnu::always_inline]] unsigned used(unsigned hit_mask) const { return hit_mask & block.used(); }
};

}  // namespace wive::WIVE_ISA
