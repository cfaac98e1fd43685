// Moves one of the meshes that a tree holds, in place and in the time that this mesh's share of the tree takes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "build/builder.h"
#include "build/mesh.h"
#include "core/parallel.h"

namespace wive {

// Keeps where in a tree the triangles of each mesh are. It serves one tree, which nothing else may change.
template <class Real>
class PartMover {
public:
    // first_faces: where the faces of each mesh begin, and how many there are; ascending.
    PartMover(const Mesh<Real>& mesh, std::span<const std::int32_t> first_faces, Threads& threads);

    // Finds the leaves of part i, unless they are known.
    void prepare(const Bvh& bvh, std::size_t i, Threads& threads);

    // Refits `bvh` to where the mesh's part i is now; all others must be where they were. No query may use the tree
    // meanwhile. False, and the tree is as it was, if the part is not prepared, or only a new tree can do that: a
    // triangle in no leaf gained area, or the tree's centre no longer suits its bounds.
    bool move(Bvh& bvh, const Mesh<Real>& mesh, std::size_t i, Threads& threads);

private:
    struct Lane {
        std::uint32_t node, lane;
    };
    struct Part {
        std::uint32_t first_face, face_count;
        Bounds bounds;
        bool is_prepared = false;
        std::vector<Lane> leaves{}, inner{};  // that hold its triangles; children before their parents
        std::vector<char> present{};          // whether a leaf holds each of its faces

        Mesh<Real> of(const Mesh<Real>& mesh) const {
            return {mesh.vertices, mesh.vertex_count, mesh.faces + std::size_t{3} * first_face, face_count};
        }
    };

    static bool has_any_gained(const Part& part, const Mesh<Real>& mesh);

    std::vector<Part> parts_;
};

}  // namespace wive
