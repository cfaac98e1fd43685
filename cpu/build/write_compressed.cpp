#include "build/write_compressed.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/error_free.h"
#include "core/ray.h"

namespace wive {
namespace {

constexpr int highest_byte = 255;

// Steps stay far from denormals, which some programs have the processor flush to zero.
constexpr int lowest_exponent = -110;

// plane - origin is not always a double. The double next to it will do: rounding is monotonic and every multiple of the
// step is a double, so the two lie on the same side of each multiple, or the rounded one is that multiple, and
// then the sign of what rounding took away decides.
struct Distance {
    double rounded, rest;

    Distance(float origin, float plane)
        : rounded(static_cast<double>(plane) - static_cast<double>(origin)),
          rest(rounded_off_sum(plane, -static_cast<double>(origin), rounded)) {}
    // The highest multiple that is not above the plane, the lowest that is not below it. No plane lies below the
    // origin, and none more than a few hundred steps above it, so truncating is floor.
    int steps_below(double step) const {
        const int steps = static_cast<int>(rounded / step);
        return steps * step == rounded && rest < 0 ? steps - 1 : steps;
    }
    int steps_above(double step) const {
        const int steps = static_cast<int>(rounded / step);
        return steps * step < rounded || rest > 0 ? steps + 1 : steps;
    }
};

// The least power of two by whose multiples 255 reach from the lowest to the highest plane.
float least_step(float lowest, float highest) {
    const Distance extent(lowest, highest);
    int exponent = lowest_exponent;
    if (extent.rounded > 0) exponent = std::max(exponent, std::ilogb(extent.rounded / highest_byte));
    while (extent.steps_above(std::ldexp(1.0, exponent)) > highest_byte) ++exponent;
    return std::ldexp(1.0f, exponent);
}

// The vertices of one block, equal where their bits are.
class SharedVertices {
public:
    void add_triangle(const Mesh<float>& mesh, std::uint32_t prim) {
        for (int k = 0; k < 3; ++k) add(mesh.corner(prim, k));
    }
    // How many of a triangle's corners are not among the vertices yet.
    int added_by(const Mesh<float>& mesh, std::uint32_t prim) const {
        SharedVertices with = *this;
        with.add_triangle(mesh, prim);
        return with.count_ - count_;
    }
    // The vertex's number; it becomes the last where it is new.
    int add(const float* vertex) {
        const Bits bits = {std::bit_cast<std::uint32_t>(vertex[0]), std::bit_cast<std::uint32_t>(vertex[1]),
                           std::bit_cast<std::uint32_t>(vertex[2])};
        const auto end = vertices_.begin() + count_;
        const auto found = std::find(vertices_.begin(), end, bits);
        if (found == end) vertices_[static_cast<std::size_t>(count_++)] = bits;
        return static_cast<int>(found - vertices_.begin());
    }
    int count() const { return count_; }
    // How many a block must have room for.
    int stored() const {
        return count_ <= CompressedBlock::few_vertices ? CompressedBlock::few_vertices : CompressedBlock::most_vertices;
    }
    std::size_t units() const { return CompressedBlock::units(static_cast<std::size_t>(stored())); }
    std::uint32_t bits(int vertex, int axis) const {
        return vertices_[static_cast<std::size_t>(vertex)][static_cast<std::size_t>(axis)];
    }

private:
    using Bits = std::array<std::uint32_t, 3>;
    std::array<Bits, 3 * block_width> vertices_;
    int count_ = 0;
};

// Hands out a leaf's triangles block by block: all that are left where they fit; else the first of them, and then,
// while there is room, the one that adds the fewest vertices.
class LeafPacker {
public:
    LeafPacker(const Mesh<float>& mesh, std::span<const std::uint32_t> prims) : mesh_(mesh), count_(prims.size()) {
        std::copy(prims.begin(), prims.end(), left_.begin());
    }
    bool done() const { return count_ == 0; }

    // The triangles of the next block; its vertices go into `vertices`.
    std::span<const std::uint32_t> next(SharedVertices& vertices) {
        if (count_ <= block_width) {
            for (std::size_t i = 0; i < count_; ++i) vertices.add_triangle(mesh_, left_[i]);
            if (vertices.count() <= CompressedBlock::most_vertices) return {left_.data(), std::exchange(count_, 0)};
            vertices = {};
        }
        std::size_t taken = 0;
        while (taken < block_width && count_ > 0) {
            std::size_t best = 0;
            int fewest = vertices.added_by(mesh_, left_[0]);
            for (std::size_t i = 1; i < count_ && taken > 0 && fewest > 0; ++i)
                if (const int added = vertices.added_by(mesh_, left_[i]); added < fewest) {
                    fewest = added;
                    best = i;
                }
            if (vertices.count() + fewest > CompressedBlock::most_vertices) break;
            vertices.add_triangle(mesh_, left_[best]);
            block_[taken++] = left_[best];
            std::copy(left_.begin() + best + 1, left_.begin() + count_, left_.begin() + best);
            --count_;
        }
        return {block_.data(), taken};
    }

private:
    const Mesh<float>& mesh_;
    std::array<std::uint32_t, max_compressed_leaf> left_;
    std::array<std::uint32_t, block_width> block_;
    std::size_t count_;
};

void write_block(const Mesh<float>& mesh, std::span<const std::uint32_t> prims, SharedVertices vertices,
                 std::byte* out) {
    const int stored = vertices.stored();
    std::uint32_t corners[2] = {0, static_cast<std::uint32_t>(stored) << 20};
    for (std::size_t lane = 0; lane < prims.size(); ++lane) {
        for (int k = 0; k < 3; ++k) {
            const auto vertex = static_cast<std::uint32_t>(vertices.add(mesh.corner(prims[lane], k)));
            corners[k >> 1] |= vertex << (16 * (k & 1) + 4 * static_cast<int>(lane));
        }
        corners[1] |= 1u << (16 + lane);
    }
    std::array<std::uint32_t, 32> words{corners[0], corners[1]};  // of the largest block
    std::size_t at = 2;
    for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i < stored; ++i) words[at++] = i < vertices.count() ? vertices.bits(i, axis) : 0;
    for (std::size_t lane = 0; lane < block_width; ++lane) words[at++] = lane < prims.size() ? prims[lane] : no_prim;
    std::memcpy(out, words.data(), vertices.units() * unit_bytes);
}

}  // namespace

void CompressedWriter::write_node(const wive::Node& node, int children, Node& out) {
    for (int axis = 0; axis < 3; ++axis) {
        const float *low = node.planes[2 * axis], *high = node.planes[2 * axis + 1];
        const float lowest = children > 0 ? *std::min_element(low, low + children) : 0.0f;
        const float highest = children > 0 ? *std::max_element(high, high + children) : 0.0f;
        const float step = least_step(lowest, highest);
        out.origin[axis] = lowest;
        out.step[axis] = step;
        for (int i = 0; i < node_width; ++i) {
            const bool used = i < children;
            const int below = used ? Distance(lowest, low[i]).steps_below(step) : highest_byte;
            const int above = used ? Distance(lowest, high[i]).steps_above(step) : 0;
            out.planes[2 * axis][i] = static_cast<std::uint8_t>(below);
            out.planes[2 * axis + 1][i] = static_cast<std::uint8_t>(above);
        }
    }
    for (int i = 0; i < node_width; ++i) {
        std::uint32_t order = 0;
        for (int octant = 0; octant < 8; ++octant) order |= (node.order[i] >> 4 * octant & 7u) << 3 * octant;
        for (int byte = 0; byte < 3; ++byte) out.order[i][byte] = static_cast<std::uint8_t>(order >> 8 * byte);
        out.child[i] = i < children ? node.child[i] : end_of_stack;
    }
}

LeafSize CompressedWriter::leaf_size(const Mesh<float>& mesh, std::span<const std::uint32_t> prims) {
    LeafSize size = {0, 0};
    for (LeafPacker packer(mesh, prims); !packer.done(); ++size.blocks) {
        SharedVertices vertices;
        packer.next(vertices);
        size.units += vertices.units();
    }
    return size;
}

LeafSize CompressedWriter::write_leaf(const Mesh<float>& mesh, Accuracy, std::span<const std::uint32_t> prims,
                                      std::byte* out) {
    LeafSize size = {0, 0};
    for (LeafPacker packer(mesh, prims); !packer.done(); ++size.blocks) {
        SharedVertices vertices;
        const auto taken = packer.next(vertices);
        write_block(mesh, taken, vertices, out + size.units * unit_bytes);
        size.units += vertices.units();
    }
    return size;
}

}  // namespace wive
