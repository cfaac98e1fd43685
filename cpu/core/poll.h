// Long work asks its caller now and then whether it should go on: Ctrl-C ends it.
#pragma once

#include <chrono>

namespace wive {

// While it lives, work that the calling thread shares in asks `check` ten times a second or so. If that throws, all
// threads stop after what they are at, and the exception reaches the caller. check: null for never.
class Poll {
public:
    using Check = void (*)();
    explicit Poll(Check check);
    ~Poll();
    Poll(const Poll&) = delete;
    Poll& operator=(const Poll&) = delete;

private:
    friend void poll_caller();
    void poll();

    const Check check_;
    Poll* const outer_;
    bool begun_ = false;
    std::chrono::steady_clock::time_point next_;
};

// Called between pieces of work, on any thread: it does something on the one that made a Poll, if it is time. Kernels
// call it, so it is compiled once and not for each instruction set.
void poll_caller();

}  // namespace wive
