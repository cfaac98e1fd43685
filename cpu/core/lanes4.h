// Four doubles that are computed with alike, of the compiler's vector type: a Number of double3.inc. Units that are
// compiled for any processor use them in functions for some (target attributes), so everything is inlined.
#pragma once

namespace wive {
namespace {  // a copy per unit: no unit is given code for another's processors

struct Lanes4 {
    static constexpr int width = 4;
    using Doubles [[gnu::vector_size(32)]] = double;
    using Integers [[gnu::vector_size(32)]] = long long;
    Doubles lanes;

#define WIVE_LANES [[gnu::always_inline]] inline
    Lanes4() = default;
    // Copied by a constructor, so that all functions pass it in memory: those for AVX have registers that others lack.
    WIVE_LANES Lanes4(const Lanes4& other) : lanes(other.lanes) {}
    WIVE_LANES Lanes4& operator=(const Lanes4& other) {
        lanes = other.lanes;
        return *this;
    }
    ~Lanes4() = default;
    WIVE_LANES explicit Lanes4(const Doubles& values) : lanes(values) {}
    WIVE_LANES Lanes4(double x) : lanes{x, x, x, x} {}
    WIVE_LANES static Lanes4 load(const double* from) { return Lanes4(*reinterpret_cast<const Doubles*>(from)); }
    WIVE_LANES void store(double* to) const { *reinterpret_cast<Doubles*>(to) = lanes; }

    WIVE_LANES friend Lanes4 operator+(const Lanes4& a, const Lanes4& b) { return Lanes4(a.lanes + b.lanes); }
    WIVE_LANES friend Lanes4 operator-(const Lanes4& a, const Lanes4& b) { return Lanes4(a.lanes - b.lanes); }
    WIVE_LANES friend Lanes4 operator*(const Lanes4& a, const Lanes4& b) { return Lanes4(a.lanes * b.lanes); }
    WIVE_LANES friend Lanes4 operator/(const Lanes4& a, const Lanes4& b) { return Lanes4(a.lanes / b.lanes); }

    // As number.inc has them.
    WIVE_LANES static Lanes4 larger(const Lanes4& a, const Lanes4& b) {
        return Lanes4(a.lanes > b.lanes ? a.lanes : b.lanes);
    }
    WIVE_LANES static Lanes4 smaller(const Lanes4& a, const Lanes4& b) {
        return Lanes4(a.lanes < b.lanes ? a.lanes : b.lanes);
    }
    WIVE_LANES static Lanes4 abs(const Lanes4& x) {
        const long long mask = 0x7fffffffffffffff;
        return Lanes4(reinterpret_cast<Doubles>(reinterpret_cast<Integers>(x.lanes) & mask));
    }
    WIVE_LANES static Lanes4 root(const Lanes4& x) {
        const Doubles& l = x.lanes;
        return Lanes4(Doubles{__builtin_sqrt(l[0]), __builtin_sqrt(l[1]), __builtin_sqrt(l[2]), __builtin_sqrt(l[3])});
    }
    WIVE_LANES static Lanes4 side(const Lanes4& x) {
        const Lanes4 below(-1.0), others(1.0), zero(0.0);
        return Lanes4(x.lanes < zero.lanes ? below.lanes : others.lanes);
    }
#undef WIVE_LANES
};

}  // namespace
}  // namespace wive
