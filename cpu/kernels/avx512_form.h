// Which of the paper's two forms of the slab test the backend "avx512" uses on this machine.
#pragma once

#include <string_view>

#include "kernels/kernels.h"

namespace wive {

// "full" or "half": the faster one here, decided by the first call. Only for machines that run AVX-512. Throws
// std::invalid_argument if the environment variable WIVE_AVX512_FORM has an unknown value.
std::string_view avx512_form();

// The kernels of that form; those of full for what half lacks (compressed nodes, stats). Null if none is compiled in.
const KernelTable<float>* avx512_kernels();

}  // namespace wive
