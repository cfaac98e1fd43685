#include "core/crc32.h"

#include <array>
#include <cstring>

#include "core/processor.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace wive {
namespace {

// A CRC is a polynomial over {0, 1} modulo this one of degree 32, whose leading term is left out (PKWARE's APPNOTE.TXT
// 4.4.7). The highest power of x is in the lowest bit.
constexpr std::uint32_t polynomial = 0xedb88320u;

constexpr std::uint32_t times_x(std::uint32_t value) { return value >> 1 ^ (value & 1 ? polynomial : 0); }

// [k][b] is the remainder of byte b with k zero bytes behind it.
using Tables = std::array<std::array<std::uint32_t, 256>, 8>;

constexpr Tables make_tables() {
    Tables tables{};
    for (std::uint32_t byte = 0; byte < 256; ++byte) {
        std::uint32_t value = byte;
        for (auto& table : tables) {
            for (int bit = 0; bit < 8; ++bit) value = times_x(value);
            table[byte] = value;
        }
    }
    return tables;
}

constexpr Tables tables = make_tables();

// The remainder of data behind other data of the remainder `state`.
std::uint32_t by_tables(std::uint32_t state, std::span<const std::byte> data) {
    const auto byte_at = [&](std::size_t i) { return std::to_integer<std::uint32_t>(data[i]); };
    std::size_t i = 0;
    for (; i + 8 <= data.size(); i += 8) {
        std::uint32_t next = 0;
        for (std::size_t k = 0; k < 4; ++k) next ^= tables[7 - k][(state >> 8 * k & 0xff) ^ byte_at(i + k)];
        for (std::size_t k = 4; k < 8; ++k) next ^= tables[7 - k][byte_at(i + k)];
        state = next;
    }
    for (; i < data.size(); ++i) state = state >> 8 ^ tables[0][(state & 0xff) ^ byte_at(i)];
    return state;
}

#if defined(__x86_64__)

#define WIVE_CLMUL __attribute__((target("pclmul,sse2")))
#define WIVE_WIDE_CLMUL __attribute__((target("vpclmulqdq,avx512f,pclmul")))

constexpr std::uint32_t one = 1u << 31;

constexpr std::uint64_t power_of_x(int n) {
    std::uint32_t power = one;
    for (int i = 0; i < n; ++i) power = times_x(power);
    return std::uint64_t{power} << 1;  // a carry-less product of reversed words is reversed but for a shift by one
}

// What data is multiplied by if so many bits follow: of 64 bits in a lower and 64 in a higher half.
template <int bits>
WIVE_CLMUL __m128i factors() {
    constexpr std::uint64_t low = power_of_x(bits + 32), high = power_of_x(bits - 32);
    return _mm_set_epi64x(static_cast<long long>(high), static_cast<long long>(low));
}

WIVE_CLMUL __m128i folded(__m128i data, __m128i by, __m128i behind) {
    const __m128i low = _mm_clmulepi64_si128(data, by, 0x00), high = _mm_clmulepi64_si128(data, by, 0x11);
    return _mm_xor_si128(_mm_xor_si128(low, high), behind);
}

WIVE_CLMUL __m128i load(const std::byte* from) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from)); }

// As by_tables, of 64 bytes or more. Folding: V. Gopal et al., "Fast CRC Computation for Generic Polynomials Using
// PCLMULQDQ Instruction", Intel 2009.
WIVE_CLMUL std::uint32_t by_folding(std::uint32_t state, std::span<const std::byte> data) {
    constexpr std::size_t word = sizeof(__m128i), words = 4;
    __m128i sums[words];
    for (std::size_t k = 0; k < words; ++k) sums[k] = load(data.data() + word * k);
    sums[0] = _mm_xor_si128(sums[0], _mm_cvtsi32_si128(static_cast<int>(state)));
    std::size_t at = words * word;
    for (const __m128i by = factors<8 * words * word>(); at + words * word <= data.size(); at += words * word)
        for (std::size_t k = 0; k < words; ++k) sums[k] = folded(sums[k], by, load(data.data() + at + word * k));
    const __m128i by = factors<8 * word>();
    for (std::size_t k = 1; k < words; ++k) sums[k] = folded(sums[k - 1], by, sums[k]);
    std::array<std::byte, word> last;
    std::memcpy(last.data(), &sums[words - 1], word);
    return by_tables(by_tables(0, last), data.subspan(at));
}

std::uint32_t remainder_by_words(std::uint32_t state, std::span<const std::byte> data) {
    return data.size() >= 64 && has_clmul() ? by_folding(state, data) : by_tables(state, data);
}

// As by_folding, of 256 bytes or more: four words are folded by one instruction.
WIVE_WIDE_CLMUL std::uint32_t by_wide_folding(std::uint32_t state, std::span<const std::byte> data) {
    constexpr std::size_t word = sizeof(__m512i), words = 4;
    constexpr int bits = 8 * words * word;
    constexpr auto low = static_cast<long long>(power_of_x(bits + 32)),
                   high = static_cast<long long>(power_of_x(bits - 32));
    const __m512i by = _mm512_set4_epi64(high, low, high, low);
    __m512i sums[words];
    for (std::size_t k = 0; k < words; ++k) sums[k] = _mm512_loadu_si512(data.data() + word * k);
    sums[0] = _mm512_xor_si512(sums[0], _mm512_set_epi64(0, 0, 0, 0, 0, 0, 0, state));
    std::size_t at = words * word;
    for (; at + words * word <= data.size(); at += words * word)
        for (std::size_t k = 0; k < words; ++k) {
            const __m512i ends = _mm512_clmulepi64_epi128(sums[k], by, 0x00);
            const __m512i begins = _mm512_clmulepi64_epi128(sums[k], by, 0x11);
            const __m512i behind = _mm512_loadu_si512(data.data() + at + word * k);
            sums[k] = _mm512_xor_si512(_mm512_xor_si512(ends, begins), behind);
        }
    std::array<std::byte, word * words> last;
    for (std::size_t k = 0; k < words; ++k) _mm512_storeu_si512(last.data() + word * k, sums[k]);
    return remainder_by_words(by_folding(0, last), data.subspan(at));
}

std::uint32_t remainder(std::uint32_t state, std::span<const std::byte> data) {
    return data.size() >= 256 && has_wide_clmul() ? by_wide_folding(state, data) : remainder_by_words(state, data);
}

#else

std::uint32_t remainder(std::uint32_t state, std::span<const std::byte> data) { return by_tables(state, data); }

#endif

}  // namespace

std::uint32_t crc32(std::span<const std::byte> data, std::uint32_t before) { return ~remainder(~before, data); }

}  // namespace wive
