// The CRC-32 of zip archives.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace wive {

// The CRC-32 of data behind other data whose CRC is `before`, 0 if there is none.
std::uint32_t crc32(std::span<const std::byte> data, std::uint32_t before);

}  // namespace wive
