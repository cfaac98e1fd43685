// Several doubles that are computed with alike, of the compiler's vector type, and their bits: a Number and a Word of
// number.inc. Each instruction set's units have their own, so everything is inlined.
#pragma once

#include <cstddef>
#include <utility>

#define WIVE_LANES [[gnu::always_inline]] inline

namespace wive {

template <class T, std::size_t count>
struct Lanes {
    typedef T Vector __attribute__((vector_size(count * sizeof(T))));
    Vector lanes;

    Lanes() = default;
    WIVE_LANES explicit Lanes(const Vector& values) : lanes(values) {}
    WIVE_LANES Lanes(T x) : lanes(x - Vector{}) {}

    // The number at `index` from each pointer on.
    template <class Real>
    WIVE_LANES static Lanes gather(const Real* const (&from)[count], std::size_t index) {
        return gather(from, index, std::make_index_sequence<count>());
    }
    template <class Real>
    WIVE_LANES void scatter(Real* const (&to)[count], std::size_t index) const {
        const auto values = __builtin_convertvector(lanes, typename Lanes<Real, count>::Vector);
        for (std::size_t lane = 0; lane < count; ++lane) to[lane][index] = values[lane];
    }

    WIVE_LANES friend Lanes operator+(const Lanes& a, const Lanes& b) { return Lanes(a.lanes + b.lanes); }
    WIVE_LANES friend Lanes operator-(const Lanes& a, const Lanes& b) { return Lanes(a.lanes - b.lanes); }
    WIVE_LANES friend Lanes operator*(const Lanes& a, const Lanes& b) { return Lanes(a.lanes * b.lanes); }
    WIVE_LANES friend Lanes operator/(const Lanes& a, const Lanes& b) { return Lanes(a.lanes / b.lanes); }
    WIVE_LANES friend Lanes operator&(const Lanes& a, const Lanes& b) { return Lanes(a.lanes & b.lanes); }
    WIVE_LANES friend Lanes operator^(const Lanes& a, const Lanes& b) { return Lanes(a.lanes ^ b.lanes); }
    WIVE_LANES friend Lanes operator~(const Lanes& a) { return Lanes(~a.lanes); }

private:
    template <class Real, std::size_t... lane>
    WIVE_LANES static Lanes gather(const Real* const (&from)[count], std::size_t index, std::index_sequence<lane...>) {
        return Lanes(Vector{static_cast<T>(from[lane][index])...});
    }
};

// As number.inc has them.
template <std::size_t count>
struct LaneNumbers {
    using Number = Lanes<double, count>;
    using Word = Lanes<long long, count>;
    using Doubles = typename Number::Vector;
    using Integers = typename Word::Vector;
    using Floats = typename Lanes<float, count>::Vector;

    WIVE_LANES static Number larger(const Number& a, const Number& b) {
        return Number(a.lanes > b.lanes ? a.lanes : b.lanes);
    }
    WIVE_LANES static Number smaller(const Number& a, const Number& b) {
        return Number(a.lanes < b.lanes ? a.lanes : b.lanes);
    }
    WIVE_LANES static Number abs(const Number& x) { return from_bits(bits(x) & Word(0x7fffffffffffffff)); }
    WIVE_LANES static Number root(const Number& x) { return root(x, std::make_index_sequence<count>()); }
    WIVE_LANES static Number side(const Number& x) { return choose(below(x, 0.0), -1.0, 1.0); }
    WIVE_LANES static Number to_float(const Number& x) { return to_float(x, std::make_index_sequence<count>()); }

    WIVE_LANES static Word below(const Number& a, const Number& b) { return Word(Integers(a.lanes < b.lanes)); }
    WIVE_LANES static Word equal(const Number& a, const Number& b) { return Word(Integers(a.lanes == b.lanes)); }
    WIVE_LANES static Number choose(const Word& mask, const Number& a, const Number& b) {
        return Number(mask.lanes ? a.lanes : b.lanes);
    }

    WIVE_LANES static Word bits(const Number& x) { return Word(reinterpret_cast<Integers>(x.lanes)); }
    WIVE_LANES static Number from_bits(const Word& x) { return Number(reinterpret_cast<Doubles>(x.lanes)); }

private:
    template <std::size_t... lane>
    WIVE_LANES static Number to_float(const Number& x, std::index_sequence<lane...>) {
        // GCC 12 forgets to round lanes that are each converted there and back, and converts a whole vector to wider
        // lanes by way of memory.
        const Floats rounded = __builtin_convertvector(x.lanes, Floats);
        return Number(Doubles{static_cast<double>(rounded[lane])...});
    }
    template <std::size_t... lane>
    WIVE_LANES static Number root(const Number& x, std::index_sequence<lane...>) {
        return Number(Doubles{__builtin_sqrt(x.lanes[lane])...});
    }
};

}  // namespace wive

#undef WIVE_LANES
