#include "write_float32.h"

#include <algorithm>
#include <limits>

namespace wive {
namespace {

void clear_block(TriangleBlock& block) {
    for (auto& row : block.rows)
        for (float& value : row) value = std::numeric_limits<float>::quiet_NaN();
    for (std::int32_t& prim : block.prim) prim = -1;
}

void write_triangle(const Mesh& mesh, Accuracy accuracy, TriangleBlock& block, std::size_t lane, std::uint32_t prim) {
    for (int k = 0; k < 3; ++k) {
        const float* corner = mesh.corner(prim, k);
        const float* first = mesh.corner(prim, 0);
        const bool edge = accuracy == Accuracy::fast && k > 0;
        for (int axis = 0; axis < 3; ++axis)
            block.rows[3 * k + axis][lane] = edge ? corner[axis] - first[axis] : corner[axis];
    }
    block.prim[lane] = static_cast<std::int32_t>(prim);
}

}  // namespace

LeafSize Float32Writer::write_leaf(const Mesh& mesh, Accuracy accuracy, std::span<const std::uint32_t> prims,
                                   std::byte* out) {
    Block* block = reinterpret_cast<Block*>(out);
    for (std::size_t i = 0; i < prims.size(); i += block_width, ++block) {
        const std::size_t count = std::min<std::size_t>(block_width, prims.size() - i);
        if (count < block_width) clear_block(*block);
        for (std::size_t k = 0; k < count; ++k) write_triangle(mesh, accuracy, *block, k, prims[i + k]);
    }
    return leaf_size(mesh, prims);
}

}  // namespace wive
