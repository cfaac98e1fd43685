// The corners of a block's four triangles as vectors, whichever form the block has: what triangle tests read.
#pragma once

#include "core/compressed.h"
#include "core/layout.h"

namespace wive {

// Rows as they are stored; in a `fast` tree those of the second and third vertex hold the edges from the first.
template <class Isa>
struct StoredCorners {
    using Real4 = typename Isa::Real4;
    using Block = TriangleBlockOf<typename Isa::Real>;

    const Block& block;

    [[gnu::always_inline]] explicit StoredCorners(const Block& of) : block(of) {}
    [[gnu::always_inline]] Real4 vertex(std::size_t k, std::size_t axis) const {
        return Real4::load(block.rows[3 * k + axis]);
    }
    [[gnu::always_inline]] Real4 edge(std::size_t k, std::size_t axis, Real4) const { return vertex(k, axis); }
    // Of lanes that passed a test, those that hold a triangle: NaN has made the others fail.
    [[gnu::always_inline]] unsigned used(unsigned lanes) const { return lanes; }
};

// Corners picked from the vertices that the triangles share.
template <class Isa>
struct SharedCorners {
    using Float4 = typename Isa::Float4;
    using Block = CompressedBlock;

    const Block& block;
    typename Isa::Pick pick[3];

    [[gnu::always_inline]] explicit SharedCorners(const Block& of)
        : block(of), pick{{of.corners[0], 0}, {of.corners[0], 16}, {of.corners[1], 0}} {
        // Where rows begin is known only when the header has come; the cache line behind it need not wait for that.
        __builtin_prefetch(reinterpret_cast<const std::byte*>(&of) + 64);
    }
    [[gnu::always_inline]] Float4 vertex(std::size_t k, std::size_t axis) const { return pick[k](block.row(axis)); }
    [[gnu::always_inline]] Float4 edge(std::size_t k, std::size_t axis, Float4 v0) const {
        return vertex(k, axis) - v0;
    }
    [[gnu::always_inline]] unsigned used(unsigned lanes) const { return lanes & block.used(); }
};

}  // namespace wive
