#include "build/binned_split.h"

#include <cstring>
#include <limits>

namespace wive {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

// Half the areas of three boxes (Box::half_area), in lanes 0 to 2.
Float4v half_areas(const Box (&box)[3], float scale) {
    const Float4v a = box[0].hi - box[0].lo, b = box[1].hi - box[1].lo, c = box[2].hi - box[2].lo;
    const Float4v xy = __builtin_shufflevector(a, b, 0, 4, 1, 5), z_ = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    const Float4v x = __builtin_shufflevector(xy, c, 0, 1, 4, 5) * scale;
    const Float4v y = __builtin_shufflevector(xy, c, 2, 3, 5, 5) * scale;
    // Lane 3 repeats lane 2: the data in a box's own lane 3 are denormals as floats, which are slow.
    const Float4v z = __builtin_shufflevector(z_, c, 0, 1, 6, 6) * scale;
    return x * y + y * z + z * x;
}

Float4v blocks_of(Int4v prims) {
    static_assert(block_width == 4);
    return __builtin_convertvector((prims + 3) >> 2, Float4v);
}

// One side of a split: its box and its number of references on each axis, as bins are added.
struct Sides {
    Box box[3];
    Int4v count = {};

    void add(const Bins& bins, int i) {
        for (int axis = 0; axis < 3; ++axis) box[axis].grow(bins.box[i][axis]);
        Int4v more;
        std::memcpy(&more, bins.count[i], sizeof more);
        count += more;
    }
    // Infinite if the side is empty, so that no such split is the best.
    Float4v cost(float scale) const {
        return count > 0 ? half_areas(box, scale) * blocks_of(count) : Float4v{} + infinity;
    }
};

}  // namespace

Split best_split(const Bins& bins, const BinMap& bin_of, float scale) {
    Float4v right_cost[max_bins];
    Sides right, left;
    for (int i = bin_of.count - 1; i > 0; --i) {
        right.add(bins, i);
        right_cost[i] = right.cost(scale);
    }
    Float4v least = Float4v{} + infinity;
    Int4v bin = {};
    for (int i = 1; i < bin_of.count; ++i) {
        left.add(bins, i - 1);
        const Float4v cost = left.cost(scale) + right_cost[i];
        const Int4v better = cost < least;
        least = better ? cost : least;
        bin = better ? Int4v{} + i : bin;
    }
    Split best;
    float best_cost = infinity;
    for (int axis = 0; axis < 3; ++axis)
        if (least[axis] < best_cost) {
            best_cost = least[axis];
            best = {axis, bin[axis]};
        }
    return best;
}

}  // namespace wive
