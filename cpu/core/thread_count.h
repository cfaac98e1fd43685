// How many threads a call uses.
#pragma once

#include <string>

namespace wive {

// The number of threads to use: `requested`; if that is 0, what set_thread_count() said; if that is 0, one per core
// that this process may use and that no other call of it uses now.
unsigned thread_count(unsigned requested);

// Sets the number of threads of calls that ask for none; 0 is one per core.
void set_thread_count(unsigned count);

// The cores that this process may use: by its affinity, and by the quotas of its control groups, rounded up. root: a
// folder that holds proc and sys, for tests.
unsigned usable_cores(const std::string& root);

// While it lives, other calls know that this one uses so many threads.
class ThreadsInUse {
public:
    explicit ThreadsInUse(unsigned count);
    ~ThreadsInUse();
    ThreadsInUse(const ThreadsInUse&) = delete;
    ThreadsInUse& operator=(const ThreadsInUse&) = delete;

private:
    const unsigned count_;
};

}  // namespace wive
