// Which of two kernel tables is faster on this machine.
#pragma once

#include "kernels/kernels.h"

namespace wive {

// Whether `challenger` is faster than `holder` by more than the noise, measured on a built-in scene in some 20 ms.
// Both must have the kernels of closest hits in watertight float32 trees.
bool is_faster(const KernelTable<float>& challenger, const KernelTable<float>& holder);

}  // namespace wive
