// Checks of a tree that was stored and may have been damaged or made up.
#pragma once

#include "build/builder.h"
#include "build/mesh.h"

namespace wive {

// Throws std::invalid_argument, which tells the first fault found, unless queries of the tree end and read nothing
// outside of it and its mesh: every child within the tree and behind its parent, nodes and blocks referenced once,
// order rows of permutations, planes and corners finite, triangles of the mesh, its depth and number of triangles as
// stated. Wrong boxes or corners are not found; checksums find those.
template <class Real>
void verify_tree(const Bvh& bvh, const Mesh<Real>& mesh, Threads& threads);

}  // namespace wive
