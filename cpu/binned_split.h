// Where to split a range of triangles: binned surface area heuristic (Wald 2007, "On fast Construction of SAH-based
// Bounding Volume Hierarchies"), all three axes in one pass.
#pragma once

#include <algorithm>
#include <cstdint>

#include "box.h"
#include "mesh.h"

namespace wive {

inline constexpr int max_bins = 32;

typedef std::int32_t Int4v __attribute__((vector_size(16)));

struct Range {
    std::uint32_t begin, end;
    int depth;
    Box box, centroids;
    std::uint32_t size() const { return end - begin; }
};

// Maps a centroid to its bin on each axis. Small ranges get few bins, as in Embree.
struct BinMap {
    Float4v base, scale;
    int count;

    explicit BinMap(const Range& range)
        : base(range.centroids.lo),
          scale{},
          count(static_cast<int>(std::min<float>(max_bins, 4.0f + 0.05f * static_cast<float>(range.size())))) {
        const Float4v extent = range.centroids.hi - range.centroids.lo;
        for (int axis = 0; axis < 3; ++axis)
            if (extent[axis] > 1e-34f) scale[axis] = 0.9999f * static_cast<float>(count) / extent[axis];
    }
    Int4v operator()(Float4v centroid) const {
        return __builtin_convertvector((centroid - base) * scale, Int4v);
    }
    // The same on one axis alone.
    int operator()(Float4v centroid, int axis) const {
        return static_cast<int>((centroid[axis] - base[axis]) * scale[axis]);
    }
};

struct Bins {
    Box box[3][max_bins];
    std::uint32_t count[3][max_bins];

    explicit Bins(int bins) {
        for (int axis = 0; axis < 3; ++axis)
            for (int i = 0; i < bins; ++i) {
                box[axis][i] = Box{};
                count[axis][i] = 0;
            }
    }
    void add(const PrimRef* refs, std::size_t begin, std::size_t end, const BinMap& bin_of) {
        for (std::size_t i = begin; i < end; ++i) {
            const Int4v bin = bin_of(refs[i].centroid());
            const Box prim = refs[i].box();
            for (int axis = 0; axis < 3; ++axis) {
                box[axis][bin[axis]].grow(prim);
                ++count[axis][bin[axis]];
            }
        }
    }
    // The box of all that falls into bins [begin, end) of an axis.
    Box box_of(int axis, int begin, int end) const {
        Box all;
        for (int i = begin; i < end; ++i) all.grow(box[axis][i]);
        return all;
    }
    void add(const Bins& other, int bins) {
        for (int axis = 0; axis < 3; ++axis)
            for (int i = 0; i < bins; ++i) {
                box[axis][i].grow(other.box[axis][i]);
                count[axis][i] += other.count[axis][i];
            }
    }
};

struct Split {
    int axis = -1;  // -1: no plane separates the centroids, halve the range
    int bin = 0;    // bins below go left
};

Split best_split(const Bins& bins, const BinMap& bin_of);

}  // namespace wive
