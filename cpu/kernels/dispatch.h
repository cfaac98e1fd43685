// Which kernels this machine can run.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "kernels/kernels.h"

namespace wive {

// Every kernel name users may give, best first, and why this machine can't run it ("" where it can).
std::vector<std::pair<std::string, std::string>> list_kernels();

// The table behind a name, for scenes of Real. Throws std::invalid_argument for a name that is unknown, can't run here
// or has no such table.
template <class Real>
const KernelTable<Real>& find_kernels(std::string_view name);

}  // namespace wive
