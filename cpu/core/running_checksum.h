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

// It doesn't depend on the pieces: each block of so many bytes has a checksum, and these are chained.
class RunningChecksum {
public:
    explicit RunningChecksum(std::size_t block) : block_(block) { last_.reserve(block); }

    void add(std::span<const std::byte> data) {
        Threads alone(1);
        while (!data.empty()) {
            const auto taken = data.first(std::min(data.size(), block_ - last_.size()));
            if (taken.size() == block_) {
                chain(taken, alone);
            } else {
                last_.insert(last_.end(), taken.begin(), taken.end());
                if (last_.size() == block_) {
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

    const std::size_t block_;
    std::uint64_t blocks_ = 0;
    std::vector<std::byte> last_;
};

}  // namespace wive
