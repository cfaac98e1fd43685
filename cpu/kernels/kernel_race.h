// Which of two kernel tables is faster on this machine.
#pragma once

#include "kernels/kernels.h"

namespace wive {

// Races the tables on a built-in scene, for some 20 ms: whether `challenger` is clearly ahead, not within the noise.
// Both must have the kernels of closest hits in watertight float32 trees.
bool is_faster(const KernelTable<float>& challenger, const KernelTable<float>& holder);

}  // namespace wive
