// An uninitialised array, on huge pages if the system has them. Traversal reads a tree in random order, and a page that
// misses the TLB costs as much as a cache miss.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <type_traits>

#include "core/memory.h"

#if defined(__linux__)
#include <sys/mman.h>
#elif defined(_WIN32)
#include <malloc.h>
#endif

namespace wive {

template <class T>
class LargeArray {
    static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

public:
    LargeArray() = default;
    explicit LargeArray(std::size_t size) : size_(size) {
        if (size == 0) return;
        constexpr std::size_t huge_page = std::size_t{2} << 20, cache_line = 64;
        const std::size_t bytes = size * sizeof(T);
        const std::size_t alignment = bytes >= huge_page ? huge_page : cache_line;
        const std::size_t rounded = (bytes + alignment - 1) / alignment * alignment;
        expect_memory(rounded);
#if defined(_WIN32)
        data_.reset(static_cast<T*>(_aligned_malloc(rounded, alignment)));
#else
        data_.reset(static_cast<T*>(std::aligned_alloc(alignment, rounded)));
#endif
        if (!data_) throw OutOfMemory("not enough memory: can't allocate " + bytes_text(rounded));
#if defined(__linux__)
        if (alignment == huge_page) madvise(data_.get(), rounded, MADV_HUGEPAGE);
#endif
    }

    T* data() { return data_.get(); }
    const T* data() const { return data_.get(); }
    std::size_t size() const { return size_; }
    std::size_t bytes() const { return size_ * sizeof(T); }
    T& operator[](std::size_t i) {
        assert(i < size_);
        return data_.get()[i];
    }
    const T& operator[](std::size_t i) const {
        assert(i < size_);
        return data_.get()[i];
    }

private:
    struct Free {
#if defined(_WIN32)
        void operator()(T* p) const { _aligned_free(p); }
#else
        void operator()(T* p) const { std::free(p); }
#endif
    };
    std::unique_ptr<T[], Free> data_;
    std::size_t size_ = 0;
};

}  // namespace wive
