// Which kernels this machine can run.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "kernels.h"

namespace wive {

// Every kernel name users may give, best first, and why this machine can't run it ("" where it can).
std::vector<std::pair<std::string, std::string>> list_kernels();

// The table behind a name. Throws std::invalid_argument for a name that is unknown or can't run here.
const KernelTable& find_kernels(std::string_view name);

}  // namespace wive
