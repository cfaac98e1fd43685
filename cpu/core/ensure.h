// Checks of invariants in release builds. For the builder, once per leaf or rarer; elsewhere an assert, which only
// debug builds check.
#pragma once

#include <stdexcept>
#include <string>

namespace wive {

// Throws std::logic_error unless the invariant holds: a fault of this library and not of its input.
inline void ensure(bool holds, const char* invariant) {
    if (!holds) [[unlikely]]
        throw std::logic_error(std::string("internal error in wive, please report it: expected ") + invariant);
}

}  // namespace wive
