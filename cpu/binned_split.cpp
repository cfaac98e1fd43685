#include "binned_split.h"

#include <limits>

#include "binary_tree.h"

namespace wive {

Split best_split(const Bins& bins, const BinMap& bin_of) {
    Split best;
    float best_cost = std::numeric_limits<float>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        if (!(bin_of.scale[axis] > 0)) continue;
        float right_cost[max_bins];
        Box right;
        std::uint32_t count = 0;
        for (int i = bin_of.count - 1; i > 0; --i) {
            right.grow(bins.box[axis][i]);
            count += bins.count[axis][i];
            right_cost[i] = count > 0 ? right.half_area() * static_cast<float>(blocks_for(count)) : -1.0f;
        }
        Box left;
        count = 0;
        for (int i = 1; i < bin_of.count; ++i) {
            left.grow(bins.box[axis][i - 1]);
            count += bins.count[axis][i - 1];
            if (count == 0 || right_cost[i] < 0) continue;
            const float cost = left.half_area() * static_cast<float>(blocks_for(count)) + right_cost[i];
            if (cost < best_cost) {
                best_cost = cost;
                best = {axis, i};
            }
        }
    }
    return best;
}

}  // namespace wive
