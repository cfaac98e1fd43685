#include "build/winding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/poll.h"

namespace wive {
namespace {

using Vector = std::array<double, 3>;

constexpr std::size_t points_per_chunk = 256;
// A child is looked at as a whole from this many of its radii away. The expansion has two terms; what it leaves out,
// and with it the error, is less than 0.03 (tests/accuracy/test_winding.py).
constexpr double far_radii = 3;

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Twice the angle that a triangle fills, seen from the coordinates' origin: van Oosterom and Strackee 1983, "The Solid
// Angle of a Plane Triangle".
double half_angle(const Vector& a, const Vector& b, const Vector& c) {
    const double la = std::sqrt(dot(a, a)), lb = std::sqrt(dot(b, b)), lc = std::sqrt(dot(c, c));
    return std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
}

template <class Real>
struct Float32Form {
    using Node = wive::Node;
    using Block = TriangleBlockOf<Real>;
};
struct CompressedForm {
    using Node = CompressedNode;
    using Block = CompressedBlock;
};
struct CompressedFloat64Form {
    using Node = CompressedNode;
    using Block = TriangleBlockOf<double>;
};

template <class Node>
bool has_child(const Node& node, int lane) {
    return node.child[lane] != end_of_stack && node.plane(low_row(0), lane) <= node.plane(high_row(0), lane);
}

}  // namespace

// Sums over the triangles of a child, and a box round them.
template <class Real>
struct WindingTable<Real>::Child {
    std::int32_t number = no_child;
    double area = 0;
    Vector middle = {};  // area times centre
    Vector dipole = {};
    double outer[3][3] = {};  // of area times centre, and normal
    Vector low = {inf, inf, inf}, high = {-inf, -inf, -inf};

    static constexpr double inf = std::numeric_limits<double>::infinity();

    void add(const Vector (&corner)[3]) {
        Vector u, v, centre;
        for (std::size_t i = 0; i < 3; ++i) {
            u[i] = corner[1][i] - corner[0][i];
            v[i] = corner[2][i] - corner[0][i];
            centre[i] = (corner[0][i] + corner[1][i] + corner[2][i]) / 3;
            low[i] = std::min({low[i], corner[0][i], corner[1][i], corner[2][i]});
            high[i] = std::max({high[i], corner[0][i], corner[1][i], corner[2][i]});
        }
        const Vector normal = cross(u, v);
        const double size = std::sqrt(dot(normal, normal)) / 2;
        area += size;
        for (std::size_t i = 0; i < 3; ++i) {
            middle[i] += size * centre[i];
            dipole[i] += normal[i] / 2;
            for (std::size_t k = 0; k < 3; ++k) outer[i][k] += centre[i] * normal[k] / 2;
        }
    }
    void add(const Child& other) {
        area += other.area;
        for (std::size_t i = 0; i < 3; ++i) {
            middle[i] += other.middle[i];
            dipole[i] += other.dipole[i];
            for (std::size_t k = 0; k < 3; ++k) outer[i][k] += other.outer[i][k];
            low[i] = std::min(low[i], other.low[i]);
            high[i] = std::max(high[i], other.high[i]);
        }
    }
};

template <class Real>
WindingTable<Real>::WindingTable(const Bvh& bvh, const Mesh<Real>& mesh) : mesh_(mesh) {
    const BvhView view = bvh.view();
    const float extent = std::max({view.extent[0], view.extent[1], view.extent[2]});
    scale_ = extent > 0 ? std::ldexp(1.0, -std::ilogb(extent)) : 1.0;
    for (int axis = 0; axis < 3; ++axis) center_[axis] = view.center[axis];
    const std::uint32_t root = inner_child(0);
    if (bvh.node_form() == NodeForm::float32)
        root_ = gather<Float32Form<Real>>(view, root).number;
    else if constexpr (precision_of<Real> == Precision::float32)
        root_ = gather<CompressedForm>(view, root).number;
    else
        root_ = gather<CompressedFloat64Form>(view, root).number;
}

template <class Real>
template <class Form>
auto WindingTable<Real>::gather(const BvhView& view, std::uint32_t reference) -> Child {
    if (is_inner(reference)) return gather_node<Form>(view, reference);
    return gather_leaf(view.leaf<Form>(reference), leaf_block_count(reference));
}

template <class Real>
template <class Form>
auto WindingTable<Real>::gather_node(const BvhView& view, std::uint32_t reference) -> Child {
    poll_caller();
    const typename Form::Node& from = view.node<Form>(reference);
    Child all;
    all.number = static_cast<std::int32_t>(nodes_.size());
    nodes_.emplace_back();
    Node node = {};
    for (int lane = 0; lane < width; ++lane) {
        if (!has_child(from, lane)) continue;
        const Child child = gather<Form>(view, from.child[lane]);
        all.add(child);
        const int k = node.children++;
        node.child[k] = child.number;
        double squared = 0;
        Vector center;
        for (std::size_t i = 0; i < 3; ++i) {
            center[i] = child.area > 0 ? child.middle[i] / child.area : (child.low[i] + child.high[i]) / 2;
            const double reach = std::max(child.high[i] - center[i], center[i] - child.low[i]);
            squared += reach * reach;
        }
        for (std::size_t i = 0; i < 3; ++i) {
            node.center[i][k] = center[i];
            node.dipole[i][k] = child.dipole[i];
            for (std::size_t j = 0; j < 3; ++j) node.spread[i][j][k] = child.outer[i][j] - center[i] * child.dipole[j];
        }
        node.radius[k] = std::sqrt(squared);
    }
    nodes_[static_cast<std::size_t>(all.number)] = node;
    return all;
}

template <class Real>
template <class Block>
auto WindingTable<Real>::gather_leaf(const Block* block, std::uint32_t blocks) -> Child {
    Child leaf;
    leaf.number = ~static_cast<std::int32_t>(leaves_.size() - 1);
    for (; blocks > 0; --blocks, block = block->next())
        for (int lane = 0; lane < block_width; ++lane) {
            const std::int32_t prim = block->prim_at(lane);
            Real corners[3][3];
            if (prim < 0 || !mesh_.load_corners(static_cast<std::size_t>(prim), corners)) continue;
            Vector corner[3];
            for (std::size_t k = 0; k < 3; ++k)
                for (std::size_t i = 0; i < 3; ++i) corner[k][i] = (corners[k][i] - center_[i]) * scale_;
            leaf.add(corner);
            prims_.push_back(static_cast<std::uint32_t>(prim));
        }
    leaves_.push_back(prims_.size());
    return leaf;
}

template <class Real>
void WindingTable<Real>::find(const Real* points, std::size_t count, double* winding, unsigned threads) const {
    Threads workers(count > points_per_chunk ? thread_count(threads) : 1);
    parallel_chunks(count, points_per_chunk, workers, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const double point[3] = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
            const double sum = point[0] + point[1] + point[2];
            winding[i] = sum - sum == 0 ? round_point(point) : std::numeric_limits<double>::quiet_NaN();
        }
    });
}

template <class Real>
double WindingTable<Real>::round_point(const double* point) const {
    Vector p;
    for (std::size_t i = 0; i < 3; ++i) p[i] = (point[i] - center_[i]) * scale_;
    std::int32_t stack[max_stack];
    int top = 0;
    if (root_ != no_child) stack[top++] = root_;
    double flux = 0, angles = 0;
    while (top > 0) {
        const std::int32_t number = stack[--top];
        if (number < 0) {
            const std::int32_t leaf = ~number;
            angles += round_leaf(static_cast<std::size_t>(leaf), point);
            continue;
        }
        const Node& node = nodes_[static_cast<std::size_t>(number)];
        double squared[width], part[width];
        for (int k = 0; k < width; ++k) {
            const double x = node.center[0][k] - p[0], y = node.center[1][k] - p[1], z = node.center[2][k] - p[2];
            const double d2 = x * x + y * y + z * z, d = std::sqrt(d2), d3 = d2 * d;
            const double along = node.dipole[0][k] * x + node.dipole[1][k] * y + node.dipole[2][k] * z;
            const double trace = node.spread[0][0][k] + node.spread[1][1][k] + node.spread[2][2][k];
            const double sx = node.spread[0][0][k] * x + node.spread[0][1][k] * y + node.spread[0][2][k] * z;
            const double sy = node.spread[1][0][k] * x + node.spread[1][1][k] * y + node.spread[1][2][k] * z;
            const double sz = node.spread[2][0][k] * x + node.spread[2][1][k] * y + node.spread[2][2][k] * z;
            squared[k] = d2;
            part[k] = (along + trace - 3 * (sx * x + sy * y + sz * z) / d2) / d3;
        }
        for (int k = 0; k < node.children; ++k) {
            const double reach = far_radii * node.radius[k];
            if (squared[k] > reach * reach)
                flux += part[k];
            else
                stack[top++] = node.child[k];
        }
    }
    return (flux + 2 * angles) / (4 * std::numbers::pi);
}

template <class Real>
double WindingTable<Real>::round_leaf(std::size_t leaf, const double* point) const {
    double angles = 0;
    for (std::size_t i = leaves_[leaf]; i < leaves_[leaf + 1]; ++i) {
        Real corners[3][3];
        if (!mesh_.load_corners(prims_[i], corners)) continue;
        Vector corner[3];
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t axis = 0; axis < 3; ++axis) corner[k][axis] = (corners[k][axis] - point[axis]) * scale_;
        angles += half_angle(corner[0], corner[1], corner[2]);
    }
    return angles;
}

template class WindingTable<float>;
template class WindingTable<double>;

}  // namespace wive
