// The hits of one thread, in the order they are found: those of rays in flight are interleaved.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/large_array.h"

namespace wive {

class HitBudget;

template <class Real>
struct FoundHit {
    std::size_t ray;  // in its batch
    Real t, u, v;
    std::int32_t prim;
};

// A list in chunks that double in size: hits are never moved, and at most half of the memory is unused. All functions
// but `add` are compiled once, in hit_list.cpp, not for each instruction set: the linker keeps one copy of an inline
// function, which might be one that this machine can't run.
template <class Real>
class alignas(64) HitList {
    using FoundHit = wive::FoundHit<Real>;

public:
    HitList();
    ~HitList();

    // Must be called before the first hit is added.
    void take_from(HitBudget& budget) { budget_ = &budget; }

    // Throws OutOfMemory if the budget or the memory has no room, with the list unchanged.
    [[gnu::always_inline]] void add(const FoundHit& hit) {
        assert(hit.prim >= 0);
        if (next_ == end_) [[unlikely]]
            grow();
        *next_++ = hit;
    }

    // Calls use(hit) for every hit, and frees each chunk when its hits have been used.
    template <class Use>
    void drain(const Use& use) {
        for (std::size_t i = 0; i < chunks_.size(); ++i) {
            LargeArray<FoundHit> chunk = std::move(chunks_[i]);
            const FoundHit* end = i + 1 < chunks_.size() ? chunk.data() + chunk.size() : next_;
            for (const FoundHit* hit = chunk.data(); hit != end; ++hit) use(*hit);
        }
        chunks_.clear();
        next_ = end_ = nullptr;
    }

private:
    void grow();

    FoundHit *next_ = nullptr, *end_ = nullptr;  // the free part of the last chunk
    HitBudget* budget_ = nullptr;
    std::vector<LargeArray<FoundHit>> chunks_;
};

}  // namespace wive
