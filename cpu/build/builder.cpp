#include "build/builder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "build/binary_tree.h"
#include "build/emit.h"
#include "build/reinsertion.h"
#include "build/write_node.h"
#include "core/ensure.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/thread_count.h"

namespace wive {

namespace {

// The largest leaf in blocks of four triangles. A compressed block may hold only two (see max_compressed_leaf).
constexpr std::uint32_t largest_leaf(Precision precision, NodeForm form) {
    const bool compressed_blocks = precision == Precision::float32 && form == NodeForm::compressed;
    return compressed_blocks ? max_compressed_leaf / block_width : max_leaf_blocks;
}

// The size of the smallest block of four triangles, in units.
constexpr std::size_t fewest_block_units(Precision precision, NodeForm form) {
    if (precision == Precision::float64) return TriangleBlockOf<double>::units();
    return form == NodeForm::compressed ? CompressedBlock::units(CompressedBlock::few_vertices)
                                        : TriangleBlock::units();
}

// Where the steps of building end, in fractions of the time, by measurement; reinsertion takes three times all others.
constexpr double refs_end = 0.12, binary_end = 0.75, high_quality_share = 0.25;

// On each axis, a mesh's middle is at most this many half extents away from its tree's centre.
constexpr double far_from_center = 4;

// A helper thread takes as long to start as some hundred triangles take to build. A small mesh is built without.
constexpr std::size_t triangles_per_thread = 2048;

unsigned threads_for(std::size_t triangles, unsigned requested) {
    const std::size_t worth = 1 + triangles / triangles_per_thread;
    return static_cast<unsigned>(std::min<std::size_t>(thread_count(requested), worth));
}

double half_size_of(const Bounds& bounds) {
    const auto& [low, high] = bounds;
    return 0.5 * std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
}

double middle_of(const Bounds& bounds, std::size_t axis) { return 0.5 * bounds[0][axis] + 0.5 * bounds[1][axis]; }

}  // namespace

template <class Real>
Bvh::Bvh(const Mesh<Real>& mesh, const BuildOptions& options) {
    facts_.accuracy = options.accuracy;
    facts_.precision = precision_of<Real>;
    facts_.form = options.nodes;
    constexpr bool doubles = precision_of<Real> == Precision::float64;
    Threads threads(threads_for(mesh.face_count, options.threads));
    if (mesh.face_count >= leaf_bit) throw too_many_triangles(mesh.face_count);
    if (doubles && facts_.accuracy == Accuracy::exact)
        throw std::invalid_argument(
            "accuracy: 'exact' takes vertices in float32, got float64; round them, or use 'watertight'");
    if constexpr (!doubles)
        if (facts_.form == NodeForm::compressed) {
            // A compressed leaf takes the memory that its vertices need, and they are counted before they are written.
            const MeshCopy copy(mesh, threads);
            build(copy.mesh(), options, threads);
            return;
        }
    build(mesh, options, threads);
}

template <class Real>
void Bvh::build(const Mesh<Real>& mesh, const BuildOptions& options, Threads& threads) {
    constexpr bool doubles = precision_of<Real> == Precision::float64;
    {
        const ProgressPart uncounted(0, 0);  // little
        check_mesh(mesh, threads);
        if constexpr (doubles) set_bounds(find_bounds(mesh, threads));
    }
    facts_.far_away = far_away_from(mesh);
    const bool high = options.quality == Quality::high;
    const double share = high ? high_quality_share : 1;
    const auto make_refs = [&] {
        const ProgressPart part(0, share * refs_end);
        return make_prim_refs(mesh, facts_.center, threads);
    };
    const auto build_binary = [&] {
        PrimRefs refs = make_refs();
        const ProgressPart part(share * refs_end, share * binary_end);
        // Before the work: if full blocks alone are too large, emit_tree would refuse the tree.
        if (refs.count / block_width * fewest_block_units(facts_.precision, facts_.form) > max_units)
            throw too_many_triangles(refs.count);
        return build_binary_tree(std::move(refs), threads, options.depth_limit,
                                 largest_leaf(facts_.precision, facts_.form));
    };
    BinaryTree tree = build_binary();
    const double emit_begin = 1 - share * (1 - binary_end);
    if (high) {
        const ProgressPart part(share * binary_end, emit_begin);
        optimize_by_reinsertion(tree, threads);
    }
    facts_.triangle_count = tree.count;
    const Point remaining_center = finish_bounds(tree.box);
    const ProgressPart last(emit_begin, 1);
    EmittedTree emitted = emit_tree(tree, mesh, options, remaining_center, threads);
    if (emitted.depth > options.depth_limit) {  // reinsertion has no depth limit, binning has
        tree = build_binary();
        emitted = emit_tree(tree, mesh, options, remaining_center, threads);
    }
    ensure(emitted.depth <= max_depth, "a tree of at most max_depth levels");
    own(std::move(emitted.units));
    facts_.node_count = emitted.node_count;
    facts_.depth = emitted.depth;
}

template Bvh::Bvh(const Mesh<float>&, const BuildOptions&);
template Bvh::Bvh(const Mesh<double>&, const BuildOptions&);

// For a mesh far from the origin, planes relative to its middle keep the boxes' slack small. Near the origin the centre
// is zero, and planes stay exact.
void Bvh::set_bounds(const Bounds& bounds) {
    facts_.bounds = bounds;
    if (!(bounds[0][0] <= bounds[1][0])) return;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double middle = middle_of(bounds, axis);
        const bool is_near_zero = std::abs(middle) <= far_from_center * half_size_of(bounds);
        facts_.center[axis] = is_near_zero ? 0.0f : static_cast<float>(middle);
    }
}

Point Bvh::finish_bounds(const Box& all) {
    Point remaining_center{};
    if (facts_.precision == Precision::float32) {
        set_bounds({{{all.lo[0], all.lo[1], all.lo[2]}, {all.hi[0], all.hi[1], all.hi[2]}}});
        remaining_center = facts_.center;
    }
    if (all.lo[0] <= all.hi[0])
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const float center = remaining_center[axis];
            facts_.extent[axis] = std::max(plane_above(all.hi[axis], center), -plane_below(all.lo[axis], center));
        }
    return remaining_center;
}

template <class Real>
bool Bvh::move_bounds(const Bounds& bounds) {
    if (!(bounds[0][0] <= bounds[1][0])) return false;
    for (std::size_t axis = 0; axis < 3; ++axis)
        if (!(std::abs(middle_of(bounds, axis) - facts_.center[axis]) <= far_from_center * half_size_of(bounds)))
            return false;
    facts_.bounds = bounds;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const float center = facts_.center[axis];
        facts_.extent[axis] = std::max(plane_above(static_cast<Real>(bounds[1][axis]), center),
                                       -plane_below(static_cast<Real>(bounds[0][axis]), center));
    }
    return true;
}

template bool Bvh::move_bounds<float>(const Bounds&);
template bool Bvh::move_bounds<double>(const Bounds&);

BvhView Bvh::view() const {
    return {units_.data(),
            {facts_.center[0], facts_.center[1], facts_.center[2], 0},
            {facts_.extent[0], facts_.extent[1], facts_.extent[2], 0},
            facts_.far_away};
}

template <class StoredNode>
Bvh::Sah Bvh::sah_of(double root) const {
    const auto half_area = [](const StoredNode& node, int lane) {
        double d[3];
        for (int axis = 0; axis < 3; ++axis)
            d[axis] = node.plane(high_row(axis), lane) - node.plane(low_row(axis), lane);
        return d[0] < 0 ? 0.0 : d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    };
    Sah sah = {1, 0};
    for (const StoredNode& node : std::span(reinterpret_cast<const StoredNode*>(units_.data()), facts_.node_count))
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
    for (std::size_t axis = 0; axis < 3; ++axis) d[axis] = facts_.bounds[1][axis] - facts_.bounds[0][axis];
    const double root = d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
    if (!(root > 0 && root < std::numeric_limits<double>::infinity())) return {0, 0};
    return facts_.form == NodeForm::float32 ? sah_of<Node>(root) : sah_of<CompressedNode>(root);
}

}  // namespace wive
