// How much memory there is, and the error for more than that.
#pragma once

#include <cstddef>
#include <new>
#include <stdexcept>
#include <string>

namespace wive {

// Memory does not suffice; Python gets a MemoryError with this text.
class OutOfMemory : public std::bad_alloc {
public:
    explicit OutOfMemory(const std::string& text) : text_(text) {}
    const char* what() const noexcept override { return text_.what(); }

private:
    std::runtime_error text_;  // a string whose copies can't fail
};

// The bytes that this process can still fill: what the system has available, and what its control groups (version 1
// and 2) leave it. The largest number if the system does not tell. Takes tens of microseconds.
// root: a folder that holds proc and sys, for tests.
std::size_t available_memory(const std::string& root = "");

// Throws OutOfMemory if there are not as many bytes. Linux grants memory that it does not have, and kills the process
// that fills it. Small amounts are not checked, which costs nothing then.
void expect_memory(std::size_t bytes);

// Whether requests for memory fail when there is none, instead of the process being killed later: the address space is
// limited, or the system grants no more than it has.
bool requests_can_fail();

// A thread that throws or polls (poll.h) for the first time needs some memory for that, and the C library ends the
// process if there is none. This takes it while there is.
void prepare_to_throw();
// prepare_to_throw() if there is memory for it; false if there is none.
bool can_throw();

// A number of bytes as people read it: "1.5 GiB".
std::string bytes_text(std::size_t bytes);

}  // namespace wive
