// The binned surface area heuristic (Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies"): where
// to split a range of triangles. All three axes in one pass.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>

#include "build/binary_tree.h"
#include "build/mesh.h"
#include "core/box.h"

namespace wive {

inline constexpr int max_bins = 32;

struct Range {
    Subtree tree;
    int depth;
    Box box, centroids;  // boxes around the references' boxes and around their centroids

    void grow(const PrimRef& ref) {
        box.grow(ref.box());
        centroids.grow(ref.centroid());
    }
    void grow(const Range& other) {
        box.grow(other.box);
        centroids.grow(other.centroids);
    }
};

struct Split {
    int axis = -1;  // -1: no plane separates the centroids
    int bin = 0;    // the first bin of the right side
};

// Maps a centroid to its bin on each axis. Small ranges get fewer bins: Embree's formula.
struct BinMap {
    Float4v base, scale;
    int count;

    // Embree's threshold: on an axis of less extent all centroids fall into bin 0.
    static constexpr float least_extent = 1e-34f;
    // Keeps the largest centroid below bin `count`.
    static constexpr float just_below_one = 0.9999f;

    explicit BinMap(const Range& range) : base(range.centroids.lo), count(bins_for(range.tree.size())) {
        const Float4v extent = range.centroids.hi - range.centroids.lo;
        const Float4v none = {};
        scale = extent > least_extent ? just_below_one * static_cast<float>(count) / extent : none;
    }
    static int bins_for(std::uint32_t size) {
        return size < 560 ? static_cast<int>(4.0f + 0.05f * static_cast<float>(size)) : max_bins;
    }
    Int4v operator()(Float4v centroid) const { return __builtin_convertvector((centroid - base) * scale, Int4v); }

    // Whether a reference goes left. The arithmetic of operator() on one axis, so both agree in every bit.
    bool goes_left(const PrimRef& ref, Split split) const {
        const float centroid = ref.lo[split.axis] + ref.hi[split.axis];
        return (centroid - base[split.axis]) * scale[split.axis] < static_cast<float>(split.bin);
    }
};

struct Bins {
    Box box[max_bins][3];
    alignas(16) std::int32_t count[max_bins][4];

    // Clears the first `bins` bins and leaves the others uninitialised.
    explicit Bins(int bins) {
        for (int i = 0; i < bins; ++i) {
            for (int axis = 0; axis < 3; ++axis) box[i][axis] = Box{};
            for (std::int32_t& n : count[i]) n = 0;
        }
    }
    void add(const PrimRef& ref, const BinMap& bin_of) {
        const Int4v bin = bin_of(ref.centroid());
        for (int axis = 0; axis < 3; ++axis) {
            assert(bin[axis] >= 0 && bin[axis] < bin_of.count);
            box[bin[axis]][axis].grow(ref.box());
            ++count[bin[axis]][axis];
        }
    }
    void add(const PrimRef* begin, const PrimRef* end, const BinMap& bin_of) {
        constexpr std::ptrdiff_t worth_two_histograms = 256;
        if (end - begin >= worth_two_histograms) {
            // Consecutive references mostly fall into the same bin, and each would stall on the store before it. Two
            // histograms, filled alternately from the two halves, double the distance between such stores.
            Bins other(bin_of.count);
            const PrimRef* const middle = begin + (end - begin) / 2;
            for (const PrimRef *a = begin, *b = middle; a < middle; ++a, ++b) {
                add(*a, bin_of);
                other.add(*b, bin_of);
            }
            begin = middle + (middle - begin);
            add(other, bin_of.count);
        }
        for (const PrimRef* ref = begin; ref < end; ++ref) add(*ref, bin_of);
    }
    // Adds the first `bins` bins of other.
    void add(const Bins& other, int bins) {
        for (int i = 0; i < bins; ++i)
            for (int axis = 0; axis < 3; ++axis) {
                box[i][axis].grow(other.box[i][axis]);
                count[i][axis] += other.count[i][axis];
            }
    }
    // The number of references that go left.
    std::uint32_t count_left(Split split) const {
        std::int32_t n = 0;
        for (int i = 0; i < split.bin; ++i) n += count[i][split.axis];
        return static_cast<std::uint32_t>(n);
    }
};

// The split of least SAH cost; of equal ones the lowest axis and bin. scale: the tree's area_scale.
Split best_split(const Bins& bins, const BinMap& bin_of, float scale);

}  // namespace wive
