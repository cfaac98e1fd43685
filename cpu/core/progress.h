// How far the work of a thread is, for the check that the thread's Poll asks now and then (poll.h).
#pragma once

#include <cstddef>

namespace wive {

// A part of the work of the thread that makes it, while it lives. Parts lie inside each other.
class ProgressPart {
public:
    // From `begin` to `end`, fractions of the part around it.
    ProgressPart(double begin, double end) : ProgressPart(begin, end - begin, nullptr, 0) {}
    // A loop that is all of the part around it. next: how many of its `count` pieces have been taken, on all threads.
    // Of loops inside each other the innermost counts.
    static ProgressPart of_loop(const std::size_t* next, std::size_t count) { return {0, 1, next, count}; }
    ~ProgressPart() { innermost = outer_; }
    ProgressPart(const ProgressPart&) = delete;
    ProgressPart& operator=(const ProgressPart&) = delete;

private:
    friend class OtherWork;
    friend double progress();
    ProgressPart(double begin, double size, const std::size_t* next, std::size_t count)
        : begin_(begin), size_(size), next_(next), count_(count), outer_(innermost) {
        innermost = this;
    }

    // Inline, because a batch of one ray makes parts as well.
    static inline constinit thread_local const ProgressPart* innermost = nullptr;

    const double begin_, size_;
    const std::size_t* const next_;
    const std::size_t count_;
    const ProgressPart* const outer_;
};

// While it lives, this thread does other work, such as what a check calls, whose parts are not parts of the first.
class OtherWork {
public:
    OtherWork() : outer_(ProgressPart::innermost) { ProgressPart::innermost = nullptr; }
    ~OtherWork() { ProgressPart::innermost = outer_; }
    OtherWork(const OtherWork&) = delete;
    OtherWork& operator=(const OtherWork&) = delete;

private:
    const ProgressPart* const outer_;
};

// The fraction of this thread's work that is done, about. It falls back to the begin of a part between the part's
// loops.
double progress();

}  // namespace wive
