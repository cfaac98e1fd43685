// Which kernels this machine can run.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "kernels/kernels.h"
#include "kernels/parts.h"

namespace wive {

// Every kernel name that users may give, best first, and why this machine can't run it ("" if it can).
std::vector<std::pair<std::string, std::string>> list_kernels();

// The table of a kernel name, for scenes of Real. Throws std::invalid_argument if the name is unknown, can't run here
// or has no such table.
template <class Real>
const KernelTable<Real>& find_kernels(std::string_view name);

// The instruction set of a kernel name. Throws as find_kernels does.
IsaName find_isa(std::string_view name);
// The best one that this machine can run.
IsaName best_isa();

}  // namespace wive
