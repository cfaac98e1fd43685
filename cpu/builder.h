// From triangles to the tree that every backend traverses.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "compressed.h"
#include "large_array.h"
#include "layout.h"
#include "mesh.h"
#include "order.h"

namespace wive {

struct BuildOptions {
    Accuracy accuracy = Accuracy::watertight;
    NodeForm nodes = NodeForm::float32;
    ChildOrder order = ChildOrder::treelet;
    unsigned threads = 0;  // 0: every core
    int depth_limit = max_depth;
};

class Bvh {
public:
    // Throws std::invalid_argument on a mesh that check_mesh refuses. The same tree whatever the threads.
    Bvh(const Mesh& mesh, const BuildOptions& options);

    BvhView view() const;
    std::size_t bytes() const { return units_.size(); }
    // As they are stored; float32 blocks have one size, compressed ones two.
    std::span<const std::byte> nodes() const { return {units_.data(), node_count_ * node_bytes()}; }
    std::span<const std::byte> blocks() const { return {units_.data() + nodes().size(), bytes() - nodes().size()}; }
    std::size_t node_bytes() const { return form_ == NodeForm::float32 ? sizeof(Node) : sizeof(CompressedNode); }
    Accuracy accuracy() const { return accuracy_; }
    NodeForm node_form() const { return form_; }
    int depth() const { return depth_; }
    std::array<std::array<float, 3>, 2> bounds() const { return bounds_; }

    struct Sah {
        double nodes, blocks;
    };
    // Surface-area cost relative to the root: node visits and triangle block tests of a ray through the root's box.
    Sah sah() const;

private:
    template <class StoredNode>
    Sah sah_of(double root) const;

    LargeArray<std::byte> units_;
    std::size_t node_count_ = 0;
    Accuracy accuracy_;
    NodeForm form_;
    int depth_ = 0;
    std::array<float, 3> center_{}, extent_{};
    std::array<std::array<float, 3>, 2> bounds_{};
};

}  // namespace wive
