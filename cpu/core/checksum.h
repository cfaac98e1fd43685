// Checksums of stored trees.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/parallel.h"

namespace wive {

// 64 bits that differ for data that differ in a single word, and for other data except by a chance of 2^-64. The same
// on any number of threads and on every machine of little-endian byte order.
std::uint64_t checksum(std::span<const std::byte> data, Threads& threads);

}  // namespace wive
