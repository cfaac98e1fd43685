// What this processor can run.
#pragma once

namespace wive {

// With FMA, BMI1, BMI2, LZCNT and POPCNT.
bool has_avx2();
// F, VL, DQ and BW, with all that has_avx2() asks for.
bool has_avx512();
// Carry-less multiplication of SSE registers.
bool has_clmul();
// And of those of AVX-512, with all that has_avx512() asks for.
bool has_wide_clmul();

}  // namespace wive
