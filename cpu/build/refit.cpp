// Refit to moved vertices: new triangles and boxes from the leaves up, the same children and orders.
#include <algorithm>
#include <atomic>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "build/builder.h"
#include "build/refit_leaf.h"
#include "build/write_node.h"
#include "core/parallel.h"
#include "core/progress.h"

namespace wive {
namespace {

// Where the fitting of boxes begins and ends, in fractions of the time of a refit, by measurement.
constexpr double fit_begin = 0.05, fit_end = 0.8;

constexpr std::size_t task_count = 256;  // about as many subtrees are fitted in parallel
constexpr std::size_t chunk_size = 1 << 12;

// Writes the leaves and computes the box of every lane, in the coordinates of box_triangle. Bvh::refitted then writes
// the planes, once the centre is known.
template <class Real>
class BoxFitter {
    // What BvhView needs to know of a tree's form. Only uncompressed trees are refitted.
    struct Form {
        using Node = wive::Node;
        using Block = TriangleBlockOf<Real>;
    };
    using Block = typename Form::Block;

public:
    BoxFitter(const BvhView& from, std::size_t node_count, std::byte* to, const Mesh<Real>& mesh, const Point& center,
              Accuracy accuracy)
        : from_(from), to_(to), mesh_(mesh), center_(center), accuracy_(accuracy), boxes_(node_width * node_count) {}

    // Computes all boxes and writes all leaves.
    void fit(Threads& threads) {
        std::vector<std::uint32_t> nodes = {inner_child(0)};  // breadth first; those before `top` are fitted last
        std::size_t top = 0;
        for (; top < nodes.size() && nodes.size() - top < task_count; ++top)
            for (const std::uint32_t child : from_.template node<Form>(nodes[top]).child)
                if (is_inner(child)) nodes.push_back(child);
        std::vector<std::size_t> lost(nodes.size());
        parallel_for(nodes.size() - top, threads, [&](std::size_t i) { fit_subtree(nodes[top + i], lost[top + i]); });
        for (std::size_t i = top; i-- > 0;)
            fit_node(nodes[i], lost[i], [&](std::uint32_t child) { return box_of(child); });
        for (const std::size_t count : lost) lost_count_ += count;
    }

    const Box* boxes(std::size_t node) const { return boxes_.data() + node_width * node; }
    Box all() const { return box_of(inner_child(0)); }
    // The triangles that no longer have an area.
    std::size_t lost_count() const { return lost_count_; }

private:
    static std::size_t index_of(std::uint32_t child) { return child_offset(child) / sizeof(Node); }

    Box box_of(std::uint32_t node) const {
        Box all;
        for (int lane = 0; lane < node_width; ++lane) all.grow(boxes(index_of(node))[lane]);
        return all;
    }

    template <class BoxOfInner>
    void fit_node(std::uint32_t node, std::size_t& lost, const BoxOfInner& box_of_inner) {
        const Node& old = from_.template node<Form>(node);
        Box* boxes = boxes_.data() + node_width * index_of(node);
        prefetch_leaves(old);
        for (int lane = 0; lane < node_width; ++lane) {
            const std::uint32_t child = old.child[lane];
            if (child == end_of_stack)
                boxes[lane] = Box{};
            else
                boxes[lane] = is_inner(child) ? box_of_inner(child) : fit_leaf(child, lost);
        }
    }

    Box fit_subtree(std::uint32_t node, std::size_t& lost) {
        fit_node(node, lost, [&](std::uint32_t child) { return fit_subtree(child, lost); });
        return box_of(node);
    }

    // Fetches what the leaves of a node are made of, which lies anywhere in memory.
    void prefetch_leaves(const Node& node) const {
        const auto each_prim = [&](const auto& fetch) {
            for (const std::uint32_t child : node.child) {
                if (is_inner(child) || child == end_of_stack) continue;
                const Block* block = from_.template leaf<Form>(child);
                for (std::uint32_t i = 0; i < leaf_block_count(child); ++i)
                    for (const std::int32_t prim : block[i].prim)
                        if (prim >= 0) fetch(static_cast<std::uint32_t>(prim));
            }
        };
        each_prim([&](std::uint32_t prim) { mesh_.prefetch_face(prim); });
        each_prim([&](std::uint32_t prim) { mesh_.prefetch_corners(prim); });
    }

    Box fit_leaf(std::uint32_t leaf, std::size_t& lost) {
        const Block* old = from_.template leaf<Form>(leaf);
        Block* block = reinterpret_cast<Block*>(to_ + child_offset(leaf));
        return refit_leaf(old, block, leaf_block_count(leaf), mesh_, center_, accuracy_,
                          [&lost](std::uint32_t) { ++lost; });
    }

    const BvhView& from_;
    std::byte* to_;
    const Mesh<Real>& mesh_;
    const Point& center_;
    Accuracy accuracy_;
    LargeArray<Box> boxes_;
    std::size_t lost_count_ = 0;
};

template <class Real>
std::span<const TriangleBlockOf<Real>> blocks_of(const Bvh& bvh) {
    using Block = TriangleBlockOf<Real>;
    const std::span<const std::byte> bytes = bvh.blocks();
    return {reinterpret_cast<const Block*>(bytes.data()), bytes.size() / sizeof(Block)};
}

// Whether a triangle that is in no leaf has an area.
template <class Real>
bool is_any_missing(std::span<const TriangleBlockOf<Real>> blocks, const Mesh<Real>& mesh, Threads& threads) {
    std::vector<char> present(mesh.face_count);
    for (const auto& block : blocks)
        for (const std::int32_t prim : block.prim)
            if (prim >= 0) present[static_cast<std::size_t>(prim)] = 1;
    std::atomic<bool> missing = false;
    parallel_chunks(mesh.face_count, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
        Box box;
        for (std::size_t i = begin; i < end; ++i)
            if (!present[i] && box_triangle(mesh, {}, i, box)) missing = true;
    });
    return missing;
}

}  // namespace

template <class Real>
std::unique_ptr<Bvh> Bvh::refitted(const Mesh<Real>& mesh, unsigned requested_threads) const {
    if (facts_.form != NodeForm::float32) return nullptr;
    Threads threads(thread_count(requested_threads));
    std::optional<ProgressPart> part(std::in_place, 0.0, fit_begin);
    check_mesh(mesh, threads);
    if (facts_.triangle_count < mesh.face_count && is_any_missing(blocks_of<Real>(*this), mesh, threads))
        return nullptr;
    std::unique_ptr<Bvh> bvh(new Bvh);
    bvh->own(LargeArray<std::byte>(units_.size()));
    std::byte* const units = bvh->memory_.data();
    bvh->facts_.node_count = facts_.node_count;
    bvh->facts_.accuracy = facts_.accuracy;
    bvh->facts_.precision = facts_.precision;
    bvh->facts_.depth = facts_.depth;
    bvh->facts_.far_away = far_away_from(mesh);
    const BvhView from = view();
    if constexpr (precision_of<Real> == Precision::float64) bvh->set_bounds(find_bounds(mesh, threads));
    BoxFitter<Real> fitter(from, facts_.node_count, units, mesh, bvh->facts_.center, facts_.accuracy);
    part.emplace(fit_begin, fit_end);
    fitter.fit(threads);
    part.emplace(fit_end, 1);
    bvh->facts_.triangle_count = facts_.triangle_count - fitter.lost_count();
    const Point remaining_center = bvh->finish_bounds(fitter.all());
    const Node* old_nodes = reinterpret_cast<const Node*>(units_.data());
    Node* to = reinterpret_cast<Node*>(units);
    parallel_chunks(facts_.node_count, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Node& old = old_nodes[i];
            for (int lane = 0; lane < node_width; ++lane)
                write_box(to[i], lane, fitter.boxes(i)[lane], remaining_center);
            std::memcpy(to[i].child, old.child, sizeof old.child);
            std::memcpy(to[i].order, old.order, sizeof old.order);
        }
    });
    return bvh;
}

template std::unique_ptr<Bvh> Bvh::refitted(const Mesh<float>&, unsigned) const;
template std::unique_ptr<Bvh> Bvh::refitted(const Mesh<double>&, unsigned) const;

}  // namespace wive
