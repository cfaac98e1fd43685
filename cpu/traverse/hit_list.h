// Every hit that one thread finds, in the order it finds them: rays in flight take turns, so theirs are mixed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/large_array.h"

namespace wive {

template <class Real>
struct FoundHit {
    std::size_t ray;  // in its batch
    Real t, u, v;
    std::int32_t prim;
};

// A list in chunks that double in size: what was found is never moved, and at most as much again stands empty.
// All but `add` is compiled once, in hit_list.cpp, not for each instruction set: the linker keeps one copy of an
// inline function, and it may be one that this machine can't run.
template <class Real>
class alignas(64) HitList {
    using FoundHit = wive::FoundHit<Real>;

public:
    HitList();
    ~HitList();

    // Throws std::bad_alloc, with the list as it was.
    [[gnu::always_inline]] void add(const FoundHit& hit) {
        if (next_ == end_) [[unlikely]]
            grow();
        *next_++ = hit;
    }

    // Calls use(hit) for each and frees the memory as it goes.
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

    FoundHit *next_ = nullptr, *end_ = nullptr;  // what is free of the last chunk
    std::vector<LargeArray<FoundHit>> chunks_;
};

}  // namespace wive
