// The generalised winding number of a mesh round points: Barill, Dickson, Schmidt, Levin, Jacobson 2018, "Fast Winding
// Numbers for Soups and Clouds".
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "build/builder.h"
#include "build/mesh.h"
#include "core/parallel.h"

namespace wive {

// For every child of a tree's nodes, what its triangles look like from far away. Made of a tree by one walk over it, in
// one thread; it keeps the numbers of triangles, and reads their corners from the mesh.
template <class Real>
class WindingTable {
public:
    WindingTable(const Bvh& bvh, const Mesh<Real>& mesh);

    // The winding number round each of (count, 3) points: about 1 inside a closed mesh, 0 outside, and in between where
    // the mesh has holes. NaN if a coordinate is NaN or infinite.
    void find(const Real* points, std::size_t count, double* winding, unsigned threads) const;

private:
    static constexpr int width = node_width;
    static constexpr std::int32_t no_child = -1;

    // Children by lane. Positions are relative to the tree's centre, and all lengths in units of its extent.
    struct Node {
        double center[3][width];     // the mean of the triangles' centres, by area
        double radius[width];        // of the ball round `center` that holds the triangles
        double dipole[3][width];     // the sum of their normals times areas
        double spread[3][3][width];  // the sum of (centre - `center`) times that
        std::int32_t child[width];   // a node, or the complement of a leaf's number
        int children;
    };
    struct Child;  // what a node's lane is made of

    template <class Form>
    Child gather(const BvhView& view, std::uint32_t reference);
    template <class Form>
    Child gather_node(const BvhView& view, std::uint32_t reference);
    template <class Block>
    Child gather_leaf(const Block* block, std::uint32_t blocks);
    double round_point(const double* point) const;
    double round_leaf(std::size_t leaf, const double* point) const;

    Mesh<Real> mesh_;
    double center_[3], scale_;
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> prims_;
    std::vector<std::size_t> leaves_ = {0};  // where each leaf's prims begin, and the last one's end
    std::int32_t root_ = no_child;
};

}  // namespace wive
