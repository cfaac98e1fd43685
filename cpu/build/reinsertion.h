// Better trees for more time: subtrees are taken out of the binary tree and put back where they enlarge it least.
#pragma once

#include "build/binary_tree.h"
#include "core/parallel.h"

namespace wive {

// The same references under a tree of lower surface area: every subtree looks for a better place (branch and bound, all
// threads; Meister, Bittner 2018, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization"), then those that
// found one move, largest gain first, each only if it still gains. Deterministic on any number of threads. False, and
// the tree is as it was, where the better one would be too deep to be walked by recursion.
bool optimize_by_reinsertion(BinaryTree& tree, Threads& threads);

}  // namespace wive
