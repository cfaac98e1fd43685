#include "build/write_compressed.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <utility>

#include "build/write_node.h"
#include "core/ensure.h"
#include "core/error_free.h"
#include "core/ray.h"

namespace wive {
namespace {

constexpr int highest_byte = CompressedNode::highest_plane;

// The least exponent of a step. Far from the exponents of denormals, which some programs have the processor flush to
// zero.
constexpr int lowest_exponent = -110;

// plane - origin, as a rounded double and the rounding error. The comparison with a multiple of the step is exact:
// every multiple is a double and rounding is monotonic, so the rounded distance is on the same side of the multiple as
// the exact one, or equal to the multiple, and then the sign of the rounding error decides.
struct Distance {
    double rounded, rest;

    Distance(float origin, float plane)
        : rounded(static_cast<double>(plane) - static_cast<double>(origin)),
          rest(rounded_off_sum(plane, -static_cast<double>(origin), rounded)) {}
    // steps_below: the highest multiple not above the plane; steps_above: the lowest not below it. A plane is not below
    // the origin and at most a few hundred steps above it, so truncation is floor.
    int steps_below(double step) const {
        const int steps = static_cast<int>(rounded / step);
        return steps * step == rounded && rest < 0 ? steps - 1 : steps;
    }
    int steps_above(double step) const {
        const int steps = static_cast<int>(rounded / step);
        return steps * step < rounded || rest > 0 ? steps + 1 : steps;
    }
};

// The least power of two of which highest_byte steps reach from the lowest plane to the highest.
float least_step(float lowest, float highest) {
    const Distance extent(lowest, highest);
    int exponent = lowest_exponent;
    if (extent.rounded > 0) exponent = std::max(exponent, std::ilogb(extent.rounded / highest_byte));
    while (extent.steps_above(std::ldexp(1.0, exponent)) > highest_byte) ++exponent;
    return std::ldexp(1.0f, exponent);
}

// The distinct vertices of one block. Vertices are equal if their bits are.
class SharedVertices {
public:
    void add_triangle(const Mesh<float>& mesh, std::uint32_t prim) {
        for (int k = 0; k < 3; ++k) add(mesh.corner(prim, k));
    }
    // The number of vertices that a triangle would add.
    int added_by(const Mesh<float>& mesh, std::uint32_t prim) const {
        SharedVertices with = *this;
        with.add_triangle(mesh, prim);
        return with.count_ - count_;
    }
    // Adds a vertex unless it is there already. Returns its number.
    int add(const float* vertex) {
        const Bits bits = {std::bit_cast<std::uint32_t>(vertex[0]), std::bit_cast<std::uint32_t>(vertex[1]),
                           std::bit_cast<std::uint32_t>(vertex[2])};
        const auto end = vertices_.begin() + count_;
        const auto found = std::find(vertices_.begin(), end, bits);
        if (found == end) {
            ensure(count_ < static_cast<int>(vertices_.size()), "at most twelve corners of four triangles");
            vertices_[static_cast<std::size_t>(count_++)] = bits;
        }
        return static_cast<int>(found - vertices_.begin());
    }
    int count() const { return count_; }
    // The number of vertices that a block for these has room for.
    int stored() const {
        ensure(count_ <= CompressedBlock::most_vertices, "at most eight vertices in a block");
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

// Divides a leaf's triangles into blocks. A block takes all remaining triangles if they fit; else the first of them,
// and then, while there is room, the one that adds the fewest vertices.
class LeafPacker {
public:
    // The builder makes no leaf of more triangles (largest_leaf in builder.cpp).
    LeafPacker(const Mesh<float>& mesh, std::span<const std::uint32_t> prims) : mesh_(mesh), count_(prims.size()) {
        ensure(count_ <= remaining_.size(), "a compressed leaf of at most 16 triangles");
        std::copy(prims.begin(), prims.end(), remaining_.begin());
    }
    bool done() const { return count_ == 0; }

    // The triangles of the next block. Sets `vertices`, which must be empty, to its vertices.
    std::span<const std::uint32_t> next(SharedVertices& vertices) {
        if (count_ <= block_width) {
            for (std::size_t i = 0; i < count_; ++i) vertices.add_triangle(mesh_, remaining_[i]);
            if (vertices.count() <= CompressedBlock::most_vertices)
                return {remaining_.data(), std::exchange(count_, 0)};
            vertices = {};
        }
        std::size_t taken = 0;
        while (taken < block_width && count_ > 0) {
            std::size_t best = 0;
            int fewest = vertices.added_by(mesh_, remaining_[0]);
            for (std::size_t i = 1; i < count_ && taken > 0 && fewest > 0; ++i)
                if (const int added = vertices.added_by(mesh_, remaining_[i]); added < fewest) {
                    fewest = added;
                    best = i;
                }
            if (vertices.count() + fewest > CompressedBlock::most_vertices) break;
            vertices.add_triangle(mesh_, remaining_[best]);
            block_[taken++] = remaining_[best];
            std::copy(remaining_.begin() + best + 1, remaining_.begin() + count_, remaining_.begin() + best);
            --count_;
        }
        return {block_.data(), taken};
    }

private:
    const Mesh<float>& mesh_;
    std::array<std::uint32_t, max_compressed_leaf> remaining_;
    std::array<std::uint32_t, block_width> block_;
    std::size_t count_;
};

// vertices: of the block's triangles and no others.
void write_block(const Mesh<float>& mesh, std::span<const std::uint32_t> prims, SharedVertices vertices,
                 std::byte* out) {
    using Block = CompressedBlock;
    const int stored = vertices.stored();
    std::uint32_t corners[Block::header_words] = {0, static_cast<std::uint32_t>(stored) << Block::vertices_shift};
    for (std::size_t lane = 0; lane < prims.size(); ++lane) {
        for (int k = 0; k < 3; ++k) {
            const auto vertex = static_cast<std::uint32_t>(vertices.add(mesh.corner(prims[lane], k)));
            corners[Block::corner_word(k)] |= vertex << Block::corner_shift(k, static_cast<int>(lane));
        }
        corners[1] |= 1u << (Block::used_shift + lane);
    }
    constexpr std::size_t most_words = Block::units(Block::most_vertices) * unit_bytes / sizeof(std::uint32_t);
    std::array<std::uint32_t, most_words> words{corners[0], corners[1]};
    std::size_t at = Block::header_words;
    for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i < stored; ++i) words[at++] = i < vertices.count() ? vertices.bits(i, axis) : 0;
    for (std::size_t lane = 0; lane < block_width; ++lane) words[at++] = lane < prims.size() ? prims[lane] : no_prim;
    std::memcpy(out, words.data(), vertices.units() * unit_bytes);
}

// Calls block(prims, vertices, first unit) for every block of a leaf. Returns the leaf's size.
template <class Block>
LeafSize pack_leaf(const Mesh<float>& mesh, std::span<const std::uint32_t> prims, const Block& block) {
    LeafSize size = {0, 0};
    for (LeafPacker packer(mesh, prims); !packer.done(); ++size.blocks) {
        SharedVertices vertices;
        const auto block_prims = packer.next(vertices);
        ensure(!block_prims.empty(), "a compressed block of at least one triangle");
        block(block_prims, vertices, size.units);
        size.units += vertices.units();
    }
    return size;
}

// The node with its children's planes moved outwards once more: compressed, the distance to each of them is rounded in
// proportion to the planes of the whole node (frame.h).
Node with_slack(const Node& node, int children) {
    Node wider = node;
    float largest = 0;
    for (const auto& row : node.planes)
        for (int i = 0; i < children; ++i) largest = std::max(largest, std::abs(row[i]));
    const float slack = largest * plane_slack_factor;
    for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i < children; ++i) {
            wider.planes[low_row(axis)][i] -= slack;
            wider.planes[high_row(axis)][i] += slack;
        }
    return wider;
}

}  // namespace

void CompressedWriter::write_node(const wive::Node& node, int children, Node& out) {
    const wive::Node wider = with_slack(node, children);
    for (int axis = 0; axis < 3; ++axis) {
        const float *low = wider.planes[low_row(axis)], *high = wider.planes[high_row(axis)];
        const float lowest = children > 0 ? *std::min_element(low, low + children) : 0.0f;
        const float highest = children > 0 ? *std::max_element(high, high + children) : 0.0f;
        const float step = least_step(lowest, highest);
        out.origin[axis] = lowest;
        out.step[axis] = step;
        for (int i = 0; i < node_width; ++i) {
            const bool used = i < children;
            const int below = used ? Distance(lowest, low[i]).steps_below(step) : highest_byte;
            const int above = used ? Distance(lowest, high[i]).steps_above(step) : 0;
            assert(below >= 0 && below <= highest_byte && above >= 0 && above <= highest_byte);
            out.planes[low_row(axis)][i] = static_cast<std::uint8_t>(below);
            out.planes[high_row(axis)][i] = static_cast<std::uint8_t>(above);
        }
    }
    for (int i = 0; i < node_width; ++i) {
        std::uint32_t order = 0;
        for (int octant = 0; octant < octants; ++octant)
            order |= (node.order[i] >> order_bits * octant & 7u) << Node::order_bits * octant;
        for (int byte = 0; byte < Node::order_bytes; ++byte)
            out.order[i][byte] = static_cast<std::uint8_t>(order >> 8 * byte);
        out.child[i] = i < children ? node.child[i] : end_of_stack;
    }
}

LeafSize CompressedWriter::leaf_size(const Mesh<float>& mesh, std::span<const std::uint32_t> prims) {
    return pack_leaf(mesh, prims, [](auto&&...) {});
}

LeafSize CompressedWriter::write_leaf(const Mesh<float>& mesh, Accuracy, std::span<const std::uint32_t> prims,
                                      std::span<std::byte> out) {
    return pack_leaf(mesh, prims, [&](auto block_prims, const SharedVertices& vertices, std::size_t unit) {
        ensure((unit + vertices.units()) * unit_bytes <= out.size(), "a leaf within the memory planned");
        write_block(mesh, block_prims, vertices, out.data() + unit * unit_bytes);
    });
}

}  // namespace wive
