// From triangles to the tree that every backend traverses.
#pragma once

#include <array>

#include "large_array.h"
#include "layout.h"
#include "mesh.h"
#include "order.h"

namespace wive {

struct BuildOptions {
    Accuracy accuracy = Accuracy::watertight;
    ChildOrder order = ChildOrder::treelet;
    unsigned threads = 0;  // 0: every core
};

class Bvh {
public:
    // Throws std::invalid_argument on a mesh that check_mesh refuses. The same tree whatever the threads.
    Bvh(const Mesh& mesh, const BuildOptions& options);

    BvhView view() const;
    const LargeArray<Node>& nodes() const { return nodes_; }
    const LargeArray<TriangleBlock>& blocks() const { return blocks_; }
    Accuracy accuracy() const { return accuracy_; }
    int depth() const { return depth_; }
    std::array<std::array<float, 3>, 2> bounds() const { return bounds_; }

    struct Sah {
        double nodes, blocks;
    };
    // Surface-area cost relative to the root: node visits and triangle block tests of a ray through the root's box.
    Sah sah() const;

private:
    LargeArray<Node> nodes_;
    LargeArray<TriangleBlock> blocks_;
    Accuracy accuracy_;
    int depth_ = 0;
    std::array<float, 3> center_{}, extent_{};
    std::array<std::array<float, 3>, 2> bounds_{};
};

}  // namespace wive
