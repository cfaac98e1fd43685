#include "build/write_float32.h"

#include <algorithm>

#include "build/write_node.h"
#include "core/ensure.h"

namespace wive {

template <class Real>
LeafSize Float32Writer<Real>::write_leaf(const Mesh<Real>& mesh, Accuracy accuracy,
                                         std::span<const std::uint32_t> prims, std::span<std::byte> out) {
    const auto triangles = static_cast<std::uint32_t>(prims.size());
    ensure(leaf_units(triangles) * unit_bytes <= out.size(), "a leaf within the memory planned");
    Block* block = reinterpret_cast<Block*>(out.data());
    for (std::size_t i = 0; i < prims.size(); i += block_width, ++block) {
        const std::size_t count = std::min<std::size_t>(block_width, prims.size() - i);
        if (count == block_width && write_full_block(*block, mesh, &prims[i], accuracy)) [[likely]]
            continue;
        if (count < block_width || block_padding<Real> > 0) clear_block(*block);
        for (std::size_t k = 0; k < count; ++k)
            write_triangle(*block, static_cast<std::uint32_t>(k), mesh, prims[i + k], accuracy);
    }
    return {leaf_units(triangles), blocks_for(triangles)};
}

template struct Float32Writer<float>;
template struct Float32Writer<double>;

}  // namespace wive
