// What translated PTX is written in: registers without types, memory spaces, and a warp's instructions.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

namespace ptx {

// PTX reads and writes any register as any type that fits; a narrow integer is extended as its type says.
class Register {
public:
    template <class T>
    T get() const {
        T value;
        std::memcpy(&value, &bits_, sizeof value);
        return value;
    }

    template <class T>
    void set(T value) {
        if constexpr (T(0.5) == T(0)) {  // an integer
            bits_ = static_cast<std::uint64_t>(value);
        } else {
            bits_ = 0;
            std::memcpy(&bits_, &value, sizeof value);
        }
    }

private:
    std::uint64_t bits_;
};

// The block that runs.
struct Block {
    unsigned char* shared;
    std::size_t shared_bytes;
    std::uint32_t index, count, threads;
};
extern Block block;

std::uint32_t thread_index();

std::uint32_t lane_index();

enum class Operation { sync, ballot, shuffle };

// The thread waits for all others in `mask` that have not ended. Returns the or of their values for a ballot, and for a
// shuffle the value of the lane `source`. `site` is the instruction, at which all of them have to meet.
std::uint32_t meet(Operation operation, const char* site, std::uint32_t mask, std::uint32_t value = 0,
                   std::uint32_t source = 0);

inline std::uint32_t ballot(const char* site, std::uint32_t mask, bool value) {
    return meet(Operation::ballot, site, mask, std::uint32_t(value) << lane_index());
}

// The value of the lane whose number differs in the bits of `which`, or of that number; `limits` says within which
// lanes, as PTX packs it.
template <bool Butterfly>
std::uint32_t shuffle(const char* site, std::uint32_t mask, std::uint32_t value, std::uint32_t which,
                      std::uint32_t limits) {
    const std::uint32_t lane = lane_index(), segment = limits >> 8 & 31u;
    const std::uint32_t last = (lane & segment) | (limits & 31u & ~segment);
    const std::uint32_t source = Butterfly ? lane ^ which : (lane & segment) | (which & ~segment);
    return meet(Operation::shuffle, site, mask, value, source <= last ? source : lane);
}

// Stops the launch with this message.
[[noreturn]] void fail(const char* format, ...);

// Before an access to shared memory another thread may run.
void let_others_run();

// What programs that are translated with their blocks tell the model: which block begins, and each access.
void step(std::int32_t block);
void access(bool writes, const unsigned char* address, std::uint32_t bytes);

// Checks an access to shared memory for races. Threads may write the same value to a word at once.
enum class Access { read, change, write_same };
void check_shared(std::size_t at, std::size_t bytes, Access access);

inline unsigned char* aligned(unsigned char* address, std::size_t bytes) {
    if (reinterpret_cast<std::uintptr_t>(address) % bytes != 0) fail("an access of %zu bytes is not aligned", bytes);
    return address;
}

inline bool is_shared(const unsigned char* address) {
    return address >= block.shared && address < block.shared + block.shared_bytes;
}

template <class T>
T load(const unsigned char* address) {
    if (is_shared(address)) {
        let_others_run();
        check_shared(address - block.shared, sizeof(T), Access::read);
    }
    T value;
    std::memcpy(&value, address, sizeof value);
    return value;
}

template <class T>
void store(unsigned char* address, T value) {
    if (is_shared(address)) {
        let_others_run();
        const bool same = std::memcmp(address, &value, sizeof value) == 0;
        check_shared(address - block.shared, sizeof(T), same ? Access::write_same : Access::change);
    }
    std::memcpy(address, &value, sizeof value);
}

template <class T>
T add_to(unsigned char* address, T value) {
    const T before = load<T>(address);
    store<T>(address, before + value);
    return before;
}

// PTX's min and max: of a number and NaN it is the number, and -0 is below +0.
template <class T>
T smaller(T a, T b) {
    if (a != a) return b;
    if (a == b && std::signbit(static_cast<double>(b))) return b;
    return b < a ? b : a;
}
template <class T>
T larger(T a, T b) {
    if (a != a) return b;
    if (a == b && std::signbit(static_cast<double>(a))) return b;
    return a < b ? b : a;
}

// Shifts by the width or more leave nothing but the sign.
template <class T>
T shift_left(T x, std::uint32_t places) {
    return places < 8 * sizeof(T) ? static_cast<T>(x << places) : T(0);
}
template <class T>
T shift_right(T x, std::uint32_t places) {
    return places < 8 * sizeof(T) ? static_cast<T>(x >> places) : static_cast<T>(x < 0 ? -1 : 0);
}

// The high word of high:low, shifted left by `places` modulo 32.
inline std::uint32_t funnel_left(std::uint32_t low, std::uint32_t high, std::uint32_t places) {
    return static_cast<std::uint32_t>(((std::uint64_t(high) << 32 | low) << (places & 31)) >> 32);
}

// `target` with `count` bits at `first` replaced by the low bits of `source`.
template <class T>
T insert_bits(T source, T target, std::uint32_t first, std::uint32_t count) {
    const T ones = count < 8 * sizeof(T) ? static_cast<T>((T(1) << count) - 1) : static_cast<T>(~T(0));
    const T mask = shift_left(ones, first);
    return static_cast<T>((target & ~mask) | (shift_left(source, first) & mask));
}

// Four of the eight bytes of b:a; bit 3 of a choice copies the byte's sign instead.
inline std::uint32_t permuted_bytes(std::uint32_t a, std::uint32_t b, std::uint32_t choices) {
    const std::uint64_t bytes = std::uint64_t(b) << 32 | a;
    std::uint32_t permuted = 0;
    for (int i = 0; i < 4; ++i) {
        const std::uint32_t choice = choices >> 4 * i & 15u;
        const std::uint32_t byte = static_cast<std::uint32_t>(bytes >> 8 * (choice & 7u)) & 255u;
        permuted |= (choice < 8 ? byte : byte >> 7 ? 255u : 0u) << 8 * i;
    }
    return permuted;
}

inline std::uint32_t leading_zeros(std::uint32_t x) { return x == 0 ? 32 : __builtin_clz(x); }

// Places that would shift the highest bit set to the top; all ones if there is none.
inline std::uint32_t places_to_top(std::uint32_t x) { return x == 0 ? ~0u : __builtin_clz(x); }

inline std::uint32_t reversed(std::uint32_t x) {
    std::uint32_t y = 0;
    for (int i = 0; i < 32; ++i) y |= (x >> i & 1u) << (31 - i);
    return y;
}

}  // namespace ptx
