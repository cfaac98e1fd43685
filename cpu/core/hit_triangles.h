// The triangles of hits that Python holds in arrays: rows of `faces`, or none.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace wive {

// An index in an array of the caller's, which another thread may write to: read once, so that what is checked is what
// is used.
template <class Index>
[[gnu::always_inline]] inline std::size_t load_index(const Index* from) {
    return static_cast<std::size_t>(static_cast<std::make_unsigned_t<Index>>(__atomic_load_n(from, __ATOMIC_RELAXED)));
}

template <class Real>
struct HitTriangles {
    const Real* points;
    const std::int32_t *corners, *prims;
    std::size_t size, face_count, point_count;

    // Where the corners of the triangle of hit i are; false if there is no such triangle.
    [[gnu::always_inline]] inline bool find(std::size_t i, const Real* (&corner)[3]) const {
        const std::size_t face = load_index(prims + i);
        return face < face_count && find_corners(face, corner);
    }

    // Those of some hits that have a triangle, in groups of `width`: the last one is filled up with its last hit.
    template <std::size_t most, std::size_t width>
    struct Found {
        std::size_t count = 0;
        std::size_t hit[most + width];
        const Real* corner[3][most + width];
    };
    // Of hits [begin, end), `most` at most. No branch depends on which rays hit, and the corners are on their way from
    // memory afterwards.
    template <std::size_t most, std::size_t width>
    [[gnu::always_inline]] inline void find(std::size_t begin, std::size_t end, Found<most, width>& found) const {
        std::size_t face[most], candidates = 0;
        for (std::size_t i = begin; i < end; ++i) {
            face[candidates] = load_index(prims + i);
            found.hit[candidates] = i;
            candidates += face[candidates] < face_count;
        }
        for (std::size_t j = 0; j < candidates; ++j) __builtin_prefetch(corners + 3 * face[j]);
        std::size_t count = 0;
        for (std::size_t j = 0; j < candidates; ++j) {
            const Real* corner[3];
            if (!find_corners(face[j], corner)) continue;
            found.hit[count] = found.hit[j];
            for (std::size_t k = 0; k < 3; ++k) {
                __builtin_prefetch(corner[k]);
                found.corner[k][count] = corner[k];
            }
            ++count;
        }
        found.count = count;
        for (std::size_t j = count; count > 0 && j < count + width; ++j) {
            found.hit[j] = found.hit[count - 1];
            for (std::size_t k = 0; k < 3; ++k) found.corner[k][j] = found.corner[k][count - 1];
        }
    }

private:
    [[gnu::always_inline]] inline bool find_corners(std::size_t face, const Real* (&corner)[3]) const {
        const std::int32_t* row = corners + 3 * face;
        const std::size_t vertex[3] = {load_index(row), load_index(row + 1), load_index(row + 2)};
        if (!((vertex[0] < point_count) & (vertex[1] < point_count) & (vertex[2] < point_count))) return false;
        for (std::size_t k = 0; k < 3; ++k) corner[k] = points + 3 * vertex[k];
        return true;
    }
};

}  // namespace wive
