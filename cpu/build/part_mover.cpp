#include "build/part_mover.h"

#include <algorithm>
#include <atomic>
#include <cassert>

#include "build/refit_leaf.h"
#include "build/write_node.h"

namespace wive {
namespace {

constexpr std::size_t chunk_size = 1 << 10;

// The box of a node's children as its planes say, which are relative to the tree's centre.
Box box_of_planes(const Node& node) {
    Box all;
    for (int lane = 0; lane < node_width; ++lane) {
        Box box;
        for (int axis = 0; axis < 3; ++axis) {
            box.lo[axis] = node.planes[low_row(axis)][lane];
            box.hi[axis] = node.planes[high_row(axis)][lane];
        }
        if (box.lo[0] <= box.hi[0]) all.grow(box);
    }
    return all;
}

}  // namespace

template <class Real>
PartMover<Real>::PartMover(const Mesh<Real>& mesh, std::span<const std::int32_t> first_faces, Threads& threads) {
    for (std::size_t i = 0; i + 1 < first_faces.size(); ++i) {
        Part part = {.first_face = static_cast<std::uint32_t>(first_faces[i]),
                     .face_count = static_cast<std::uint32_t>(first_faces[i + 1] - first_faces[i]),
                     .bounds = {}};
        part.bounds = find_bounds(part.of(mesh), threads);
        parts_.push_back(std::move(part));
    }
}

template <class Real>
void PartMover<Real>::prepare(const Bvh& bvh, std::size_t i, Threads& threads) {
    Part& part = parts_[i];
    if (part.is_prepared) return;
    using Block = TriangleBlockOf<Real>;
    const std::byte* const units = bvh.units().data();
    const Node* const nodes = reinterpret_cast<const Node*>(units);
    const std::size_t count = bvh.facts().node_count;
    part.present.assign(part.face_count, 0);
    const auto holds_any = [&](std::uint32_t leaf) {
        const auto* block = reinterpret_cast<const Block*>(units + child_offset(leaf));
        bool any = false;
        for (std::uint32_t k = 0; k < leaf_block_count(leaf); ++k)
            for (const std::int32_t prim : block[k].prim) {
                const std::uint32_t face = static_cast<std::uint32_t>(prim) - part.first_face;
                if (prim < 0 || face >= part.face_count) continue;
                part.present[face] = 1;
                any = true;
            }
        return any;
    };
    std::vector<std::vector<Lane>> found((count + chunk_size - 1) / chunk_size);
    parallel_chunks(count, chunk_size, threads, [&](std::size_t begin, std::size_t end) {
        std::vector<Lane> lanes;
        for (std::size_t node = begin; node < end; ++node)
            for (std::uint32_t lane = 0; lane < node_width; ++lane) {
                const std::uint32_t child = nodes[node].child[lane];
                if (!is_inner(child) && child != end_of_stack && holds_any(child))
                    lanes.push_back({static_cast<std::uint32_t>(node), lane});
            }
        found[begin / chunk_size] = std::move(lanes);
    });
    std::vector<char> is_moved(count);
    for (const std::vector<Lane>& lanes : found)
        for (const Lane& lane : lanes) {
            part.leaves.push_back(lane);
            is_moved[lane.node] = 1;
        }
    for (std::size_t node = count; node-- > 0;)
        for (std::uint32_t lane = 0; lane < node_width; ++lane) {
            const std::uint32_t child = nodes[node].child[lane];
            if (!is_inner(child)) continue;
            const std::size_t below = child_offset(child) / sizeof(Node);
            assert(below > node && below < count);
            if (!is_moved[below]) continue;
            part.inner.push_back({static_cast<std::uint32_t>(node), lane});
            is_moved[node] = 1;
        }
    part.is_prepared = true;
}

// Whether a triangle of the part that is in no leaf has an area.
template <class Real>
bool PartMover<Real>::has_any_gained(const Part& part, const Mesh<Real>& mesh) {
    for (std::size_t face = 0; face < part.face_count; ++face) {
        Box box;
        if (!part.present[face] && box_triangle(mesh, {}, part.first_face + face, box)) return true;
    }
    return false;
}

template <class Real>
bool PartMover<Real>::move(Bvh& bvh, const Mesh<Real>& mesh, std::size_t i, Threads& threads) {
    using Block = TriangleBlockOf<Real>;
    Part& part = parts_[i];
    if (!bvh.can_change() || !part.is_prepared || has_any_gained(part, mesh)) return false;
    const Bounds own = find_bounds(part.of(mesh), threads);
    Bounds all = own;
    for (const Part& other : parts_)
        if (&other != &part) grow(all, other.bounds[0], other.bounds[1]);
    if (!bvh.move_bounds<Real>(all)) return false;

    // From here on nothing throws.
    part.bounds = own;
    bvh.facts_.far_away = far_away_from(mesh);
    const Point center = bvh.facts_.center;
    const Point remaining_center = precision_of<Real> == Precision::float32 ? center : Point{};
    std::byte* const units = bvh.memory_.data();
    Node* const nodes = reinterpret_cast<Node*>(units);
    std::atomic<std::size_t> lost = 0;
    parallel_chunks(part.leaves.size(), chunk_size, threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const auto [node, lane] = part.leaves[k];
            const std::uint32_t leaf = nodes[node].child[lane];
            Block* const blocks = reinterpret_cast<Block*>(units + child_offset(leaf));
            const Box box = refit_leaf(blocks, blocks, leaf_block_count(leaf), mesh, center, bvh.accuracy(),
                                       [&](std::uint32_t prim) {
                                           ++lost;
                                           if (prim - part.first_face < part.face_count)
                                               part.present[prim - part.first_face] = 0;
                                       });
            write_box(nodes[node], static_cast<int>(lane), box, remaining_center);
        }
    });
    bvh.facts_.triangle_count -= lost;
    for (const auto& [node, lane] : part.inner) {
        const Node& below = nodes[child_offset(nodes[node].child[lane]) / sizeof(Node)];
        write_box(nodes[node], static_cast<int>(lane), box_of_planes(below), {});
    }
    return true;
}

template class PartMover<float>;
template class PartMover<double>;

}  // namespace wive
