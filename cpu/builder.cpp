#include "builder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "binary_tree.h"
#include "emit.h"
#include "parallel.h"

namespace wive {

namespace {

// In blocks of four triangles.
constexpr std::uint32_t largest_leaf(NodeForm form) {
    return form == NodeForm::float32 ? max_leaf_blocks : max_compressed_leaf / block_width;
}

}  // namespace

Bvh::Bvh(const Mesh& mesh, const BuildOptions& options) : accuracy_(options.accuracy), form_(options.nodes) {
    const unsigned threads = thread_count(options.threads);
    if (mesh.face_count >= leaf_bit) throw std::invalid_argument("faces: too many triangles for one scene");
    check_mesh(mesh, threads);
    std::size_t count = 0;
    LargeArray<PrimRef> refs = make_prim_refs(mesh, threads, count);
    const BinaryTree tree = build_binary_tree(std::move(refs), static_cast<std::uint32_t>(count), threads,
                                              options.depth_limit, largest_leaf(form_));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        bounds_[0][axis] = tree.box.lo[axis];
        bounds_[1][axis] = tree.box.hi[axis];
    }
    if (count > 0) {
        // Far from the origin, planes relative to the middle keep the boxes' slack small. Near it, the planes
        // are left as they are, and so stay exact.
        const Float4v middle = tree.box.lo * 0.5f + tree.box.hi * 0.5f;
        const Float4v half = tree.box.hi * 0.5f - tree.box.lo * 0.5f;
        const float size = std::max({half[0], half[1], half[2]});
        for (std::size_t axis = 0; axis < 3; ++axis) {
            center_[axis] = std::abs(middle[axis]) > 4 * size ? middle[axis] : 0.0f;
            extent_[axis] = std::max(plane_above(bounds_[1][axis], center_[axis]),
                                     -plane_below(bounds_[0][axis], center_[axis]));
        }
    }
    EmittedTree emitted = emit_tree(tree, mesh, options, center_, threads);
    units_ = std::move(emitted.units);
    node_count_ = emitted.node_count;
    depth_ = emitted.depth;
}

BvhView Bvh::view() const {
    return {units_.data(), {center_[0], center_[1], center_[2], 0}, {extent_[0], extent_[1], extent_[2], 0}};
}

template <class StoredNode>
Bvh::Sah Bvh::sah_of(double root) const {
    const auto half_area = [](const StoredNode& node, int lane) {
        double d[3];
        for (int axis = 0; axis < 3; ++axis) d[axis] = node.plane(2 * axis + 1, lane) - node.plane(2 * axis, lane);
        return d[0] < 0 ? 0.0 : d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    };
    Sah sah = {1, 0};
    for (const StoredNode& node : std::span(reinterpret_cast<const StoredNode*>(units_.data()), node_count_))
        for (int lane = 0; lane < node_width; ++lane) {
            const std::uint32_t child = node.child[lane];
            const double area = half_area(node, lane) / root;
            if (is_inner(child))
                sah.nodes += area;
            else
                sah.blocks += area * leaf_block_count(child);
        }
    return sah;
}

Bvh::Sah Bvh::sah() const {
    double d[3];
    for (std::size_t axis = 0; axis < 3; ++axis) d[axis] = static_cast<double>(bounds_[1][axis]) - bounds_[0][axis];
    const double root = d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    if (!(root > 0 && root < std::numeric_limits<double>::infinity())) return {0, 0};
    return form_ == NodeForm::float32 ? sah_of<Node>(root) : sah_of<CompressedNode>(root);
}

}  // namespace wive
