// From triangles to the tree that every backend traverses.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>

#include "build/mesh.h"
#include "build/order.h"
#include "core/box.h"
#include "core/compressed.h"
#include "core/large_array.h"
#include "core/layout.h"

namespace wive {

// medium: binned SAH. high: the same tree optimised further, for several times the build time.
enum class Quality { medium, high };

struct BuildOptions {
    Accuracy accuracy = Accuracy::watertight;
    NodeForm nodes = NodeForm::float32;
    ChildOrder order = ChildOrder::treelet;
    unsigned threads = 0;  // 0: every core
    int depth_limit = max_depth;
    Quality quality = Quality::medium;
};

class Bvh {
public:
    // Throws std::invalid_argument on a mesh that check_mesh refuses. The same tree whatever the threads.
    template <class Real>
    Bvh(const Mesh<Real>& mesh, const BuildOptions& options);

    // The same tree over moved vertices; null where a triangle that had no area, and so no leaf, now has one, and for
    // compressed trees, whose leaves may need other sizes. Throws as building does.
    // Real is that of the mesh it was built from.
    template <class Real>
    std::unique_ptr<Bvh> refitted(const Mesh<Real>& mesh, unsigned threads) const;

    BvhView view() const;
    std::size_t bytes() const { return units_.size(); }
    // As they are stored; float32 blocks have one size, compressed ones two.
    std::span<const std::byte> nodes() const { return {units_.data(), node_count_ * node_bytes()}; }
    std::span<const std::byte> blocks() const { return {units_.data() + nodes().size(), bytes() - nodes().size()}; }
    std::size_t node_bytes() const { return form_ == NodeForm::float32 ? sizeof(Node) : sizeof(CompressedNode); }
    Accuracy accuracy() const { return accuracy_; }
    Precision precision() const { return precision_; }
    NodeForm node_form() const { return form_; }
    int depth() const { return depth_; }
    const Bounds& bounds() const { return bounds_; }

    struct Sah {
        double nodes, blocks;
    };
    // Surface-area cost relative to the root: node visits and triangle block tests of a ray through the root's box.
    Sah sah() const;

private:
    Bvh() = default;
    void set_bounds(const Bounds& bounds);
    Point settle(const Box& all);
    template <class StoredNode>
    Sah sah_of(double root) const;

    LargeArray<std::byte> units_;
    std::size_t node_count_ = 0, triangle_count_ = 0;
    Accuracy accuracy_ = Accuracy::watertight;
    Precision precision_ = Precision::float32;
    NodeForm form_ = NodeForm::float32;
    int depth_ = 0;
    Point center_{}, extent_{};
    Bounds bounds_{};
};

}  // namespace wive
