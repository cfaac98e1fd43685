// Optimisation of the binary tree by reinsertion: subtrees are removed and inserted again where they enlarge it least.
#pragma once

#include "build/binary_tree.h"
#include "core/parallel.h"

namespace wive {

// Lowers the surface area of a tree over the same references (Meister, Bittner 2018, "Parallel Reinsertion for Bounding
// Volume Hierarchy Optimization"). In each round all threads search a better place for every subtree by branch and
// bound; then subtrees move, largest gain first, each only if it still gains. The same tree on any number of threads.
// Returns false, and leaves the tree as it was, if the optimised one would be too deep for recursion.
bool optimize_by_reinsertion(BinaryTree& tree, Threads& threads);

}  // namespace wive
