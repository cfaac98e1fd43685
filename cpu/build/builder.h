// Builds the tree that every backend traverses from a mesh.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <utility>

#include "build/far_away.h"
#include "build/mesh.h"
#include "core/box.h"
#include "core/compressed.h"
#include "core/large_array.h"
#include "core/layout.h"

namespace wive {

// medium: binned SAH. high: that tree, optimised by reinsertion for several times the build time.
enum class Quality { medium, high };

struct BuildOptions {
    Accuracy accuracy = Accuracy::watertight;
    NodeForm nodes = NodeForm::float32;
    unsigned threads = 0;  // 0: one per core
    int depth_limit = max_depth;
    Quality quality = Quality::medium;
};

// What queries need to know of a tree besides its nodes and blocks.
struct TreeFacts {
    std::size_t node_count = 0, triangle_count = 0;  // triangles in leaves
    Accuracy accuracy = Accuracy::watertight;
    Precision precision = Precision::float32;
    NodeForm form = NodeForm::float32;
    int depth = 0;
    Point center{}, extent{};  // those of BvhView
    float far_away = 0;
    Bounds bounds{};

    std::size_t node_bytes() const { return form == NodeForm::float32 ? sizeof(Node) : sizeof(CompressedNode); }
};

class Bvh {
public:
    // Throws std::invalid_argument for a mesh that check_mesh refuses. The same tree on any number of threads.
    template <class Real>
    Bvh(const Mesh<Real>& mesh, const BuildOptions& options);

    // A tree over memory of others, which must hold its nodes and outlive it; aligned to 64 bytes. It is not checked:
    // see verify.h.
    Bvh(const TreeFacts& facts, std::span<const std::byte> units) : facts_(facts), units_(units) {}

    // Whether its nodes and blocks can be changed in place: they are not compressed, nor others'.
    bool can_change() const { return facts_.form == NodeForm::float32 && memory_.size() > 0; }

    // Refits to moved vertices: new boxes and triangles, the same children and orders. Returns null if refitting is
    // impossible: a formerly degenerate triangle (in no leaf) gained area, or the tree is compressed (leaf sizes depend
    // on vertices). Throws as the constructor does. Real must be that of the mesh the tree was built from.
    template <class Real>
    std::unique_ptr<Bvh> refitted(const Mesh<Real>& mesh, unsigned threads) const;

    BvhView view() const;
    Distant distant() const { return distant_from(facts_.bounds, facts_.far_away); }
    std::size_t bytes() const { return units_.size(); }
    std::span<const std::byte> units() const { return units_; }
    // The stored bytes of all nodes and of all blocks. Compressed blocks have two sizes (see CompressedBlock).
    std::span<const std::byte> nodes() const { return units_.first(facts_.node_count * node_bytes()); }
    std::span<const std::byte> blocks() const { return units_.subspan(nodes().size()); }
    std::size_t node_bytes() const { return facts_.node_bytes(); }
    const TreeFacts& facts() const { return facts_; }
    Accuracy accuracy() const { return facts_.accuracy; }
    Precision precision() const { return facts_.precision; }
    NodeForm node_form() const { return facts_.form; }
    int depth() const { return facts_.depth; }
    const Bounds& bounds() const { return facts_.bounds; }

    struct Sah {
        double nodes, blocks;
    };
    // Surface area cost: the expected node visits and triangle block tests of a ray through the root's box.
    Sah sah() const;

private:
    template <class Real>
    friend class PartMover;

    Bvh() = default;
    template <class Real>
    void build(const Mesh<Real>& mesh, const BuildOptions& options, Threads& threads);
    // Sets the bounds and the centre that follows from them.
    void set_bounds(const Bounds& bounds);
    // Sets bounds (float32) and extent from the box of all triangles. Returns the point to subtract from
    // planes: the centre, or zero for float64, whose boxes are relative to the centre from box_triangle on.
    Point finish_bounds(const Box& all);
    // Sets bounds and extent of a tree whose centre stays. False, and nothing is set, if the centre is too far from
    // them, or if there are none.
    template <class Real>
    bool move_bounds(const Bounds& bounds);
    template <class StoredNode>
    Sah sah_of(double root) const;
    // Takes the memory of nodes and blocks.
    void own(LargeArray<std::byte> units) {
        memory_ = std::move(units);
        units_ = {memory_.data(), memory_.size()};
    }

    TreeFacts facts_;
    LargeArray<std::byte> memory_;  // empty if the units are others'
    std::span<const std::byte> units_;
};

}  // namespace wive
