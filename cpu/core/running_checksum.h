// A checksum of bytes that come in pieces.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/checksum.h"

namespace wive {

// It doesn't depend on the pieces: each block has a checksum, and these are chained.
class RunningChecksum {
public:
    // Bytes under one checksum: whole rows of 6 or 8 numbers of 4 or 8 bytes, few enough to stay in a cache while they
    // are read, summed up and split into origins and directions.
    static constexpr std::size_t block_bytes = 3 << 17;

    RunningChecksum() { last_.reserve(block_bytes); }

    void add(std::span<const std::byte> data) {
        Threads alone(1);
        while (!data.empty()) {
            const auto taken = data.first(std::min(data.size(), block_bytes - last_.size()));
            if (taken.size() == block_bytes) {
                chain(taken, alone);
            } else {
                last_.insert(last_.end(), taken.begin(), taken.end());
                if (last_.size() == block_bytes) {
                    chain(last_, alone);
                    last_.clear();
                }
            }
            data = data.subspan(taken.size());
        }
    }
    // Of the whole blocks, and of what is behind them.
    std::pair<std::uint64_t, std::uint64_t> both() const {
        Threads alone(1);
        return {blocks_, checksum(last_, alone)};
    }

private:
    void chain(std::span<const std::byte> block, Threads& alone) {
        const std::uint64_t next[] = {blocks_, checksum(block, alone)};
        blocks_ = checksum(std::as_bytes(std::span(next)), alone);
    }

    std::uint64_t blocks_ = 0;
    std::vector<std::byte> last_;
};

}  // namespace wive
