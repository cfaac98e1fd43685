// Runs a block's threads, warp by warp: each thread is a fiber, and at most one runs at a time.
#include "machine.h"

#include <ucontext.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <vector>

namespace ptx {

Block block;

namespace {

constexpr unsigned WARP = 32;
constexpr std::size_t STACK_BYTES = 1 << 18;
// One access to shared memory in so many lets another thread run first.
constexpr unsigned ACCESSES_PER_SWITCH = 16;

// Times are counted by each thread for itself: a thread knows what another did until a certain time of that thread.
using Clock = std::array<std::uint32_t, WARP>;

enum class State { ready, waits, ended };

struct Thread {
    ucontext_t context;
    State state;
    std::uint32_t index;
    Clock knows;
    // What it waits for, and what it gets.
    Operation operation;
    const char* site;
    std::uint32_t mask, value, source, result;
};

// Who wrote a word of shared memory last, and who read it when, each in that thread's own time; 0 is never.
struct Word {
    unsigned writer = 0;
    std::uint32_t written = 0;
    Clock read{};
};

struct Machine {
    std::array<Thread, WARP> threads;
    std::array<std::vector<unsigned char>, WARP> stacks;
    ucontext_t scheduler;
    unsigned running;
    std::uint64_t random;
    std::vector<Word> words;
    void (*entry)(const unsigned char* const*);
    const unsigned char* const* parameters;
    char* error;
    std::size_t error_bytes;
};
Machine machine;

unsigned draw(unsigned count) {  // xorshift64, Marsaglia 2003
    std::uint64_t& x = machine.random;
    x ^= x << 13;
    x ^= x >> 7;
    x ^= x << 17;
    return static_cast<unsigned>((x >> 32) % count);
}

Thread& self() { return machine.threads[machine.running]; }

void leave() { swapcontext(&self().context, &machine.scheduler); }

void run_thread() {
    machine.entry(machine.parameters);
    self().state = State::ended;
    leave();
}

void begin_warp(std::uint32_t first) {
    for (unsigned lane = 0; lane < WARP; ++lane) {
        Thread& thread = machine.threads[lane];
        thread.index = first + lane;
        thread.state = thread.index < block.threads ? State::ready : State::ended;
        thread.knows.fill(0);
        thread.knows[lane] = 1;
        machine.stacks[lane].resize(STACK_BYTES);
        getcontext(&thread.context);
        thread.context.uc_stack.ss_sp = machine.stacks[lane].data();
        thread.context.uc_stack.ss_size = STACK_BYTES;
        thread.context.uc_link = nullptr;
        makecontext(&thread.context, run_thread, 0);
    }
    std::fill(machine.words.begin(), machine.words.end(), Word{});
}

// The lanes that wait with this one, if all that its mask names do or have ended; else none.
std::vector<unsigned> complete_group(const Thread& first) {
    std::vector<unsigned> group;
    for (unsigned lane = 0; lane < WARP; ++lane) {
        const Thread& thread = machine.threads[lane];
        if (!(first.mask >> lane & 1u) || thread.state == State::ended) continue;
        const bool same =
            thread.state == State::waits && thread.mask == first.mask && thread.operation == first.operation;
        if (!same) return {};
        group.push_back(lane);
    }
    return group;
}

// Lets every group go on whose threads have all arrived; false if there is none.
bool release() {
    bool any = false;
    for (const Thread& first : machine.threads) {
        if (first.state != State::waits) continue;
        const std::vector<unsigned> group = complete_group(first);
        if (group.empty()) continue;
        any = true;
        std::uint32_t all = 0;
        Clock known = machine.threads[group[0]].knows;
        for (const unsigned lane : group) {
            const Thread& thread = machine.threads[lane];
            if (thread.site != machine.threads[group[0]].site) {
                std::snprintf(machine.error, machine.error_bytes,
                              "lanes %u and %u meet at different instructions: %s and %s", group[0], lane,
                              machine.threads[group[0]].site, thread.site);
                return false;
            }
            if (thread.operation == Operation::shuffle && std::ranges::find(group, thread.source) == group.end()) {
                std::snprintf(machine.error, machine.error_bytes,
                              "lane %u shuffles with lane %u, which is not there: %s", lane, thread.source,
                              thread.site);
                return false;
            }
            all |= thread.value;
            for (unsigned i = 0; i < WARP; ++i) known[i] = std::max(known[i], thread.knows[i]);
        }
        for (const unsigned lane : group) {
            Thread& thread = machine.threads[lane];
            // CUDA orders memory at bar.warp.sync only, not at votes and shuffles.
            if (thread.operation == Operation::sync) {
                thread.knows = known;
                ++thread.knows[lane];
            }
            const bool shuffles = thread.operation == Operation::shuffle;
            thread.result = shuffles ? machine.threads[thread.source].value : all;
            thread.state = State::ready;
        }
    }
    return any;
}

void report_deadlock() {
    std::size_t end = std::snprintf(machine.error, machine.error_bytes, "deadlock:");
    for (unsigned lane = 0; lane < WARP && end < machine.error_bytes; ++lane) {
        const Thread& thread = machine.threads[lane];
        if (thread.state != State::waits) continue;
        end += std::snprintf(machine.error + end, machine.error_bytes - end, " lane %u waits for %08x at %s;", lane,
                             thread.mask, thread.site);
    }
}

// Runs the warp until all its threads have ended, or one fails.
void run_warp() {
    while (machine.error[0] == 0) {
        std::array<unsigned, WARP> ready;
        unsigned count = 0, waiting = 0;
        for (unsigned lane = 0; lane < WARP; ++lane) {
            if (machine.threads[lane].state == State::ready) ready[count++] = lane;
            if (machine.threads[lane].state == State::waits) ++waiting;
        }
        if (count == 0 && waiting == 0) return;
        if (count == 0) {
            if (!release() && machine.error[0] == 0) report_deadlock();
            continue;
        }
        machine.running = ready[draw(count)];
        swapcontext(&machine.scheduler, &self().context);
        if (draw(2) == 0) release();
    }
}

void check_race(const char* what, unsigned other, std::uint32_t time, std::size_t at) {
    if (other != machine.running && time > self().knows[other])
        fail("race: %s at byte %zu of shared memory, lanes %u and %u", what, at, other, machine.running);
}

}  // namespace

std::uint32_t thread_index() { return self().index; }

void fail(const char* format, ...) {
    std::va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(machine.error, machine.error_bytes, format, arguments);
    va_end(arguments);
    leave();
    std::abort();  // the scheduler never returns to a thread that failed
}

std::uint32_t lane_index() { return machine.running; }

std::uint32_t meet(Operation operation, const char* site, std::uint32_t mask, std::uint32_t value,
                   std::uint32_t source) {
    Thread& thread = self();
    if (!(mask >> machine.running & 1u))
        fail("mask %08x does not name its own lane %u: %s", mask, machine.running, site);
    thread.operation = operation;
    thread.site = site;
    thread.mask = mask;
    thread.value = value;
    thread.source = source;
    thread.state = State::waits;
    leave();
    return thread.result;
}

void let_others_run() {
    if (draw(ACCESSES_PER_SWITCH) == 0) leave();
}

void check_shared(std::size_t at, std::size_t bytes, Access access) {
    const std::uint32_t now = self().knows[machine.running];
    for (std::size_t i = at / 4; i <= (at + bytes - 1) / 4; ++i) {
        Word& word = machine.words[i];
        if (access == Access::read) check_race("read after write", word.writer, word.written, at);
        if (access == Access::change) {
            check_race("write after write", word.writer, word.written, at);
            for (unsigned other = 0; other < WARP; ++other) check_race("write after read", other, word.read[other], at);
        }
        if (access == Access::read) {
            word.read[machine.running] = now;
        } else {
            word.writer = machine.running;
            word.written = now;
        }
    }
}

// Runs a grid of blocks, one after another, and calls `warp_ended()` after each warp. If something fails `error` says
// what did.
template <class Function>
void run_grid(void (*entry)(const unsigned char* const*), const unsigned char* const* parameters, std::uint32_t blocks,
              std::uint32_t threads, std::size_t shared_bytes, std::uint64_t seed, char* error, std::size_t error_bytes,
              Function warp_ended) {
    // What shared memory holds at first is undefined.
    std::vector<std::uint64_t> shared(shared_bytes / 8 + 1, 0xC5C5C5C5C5C5C5C5u);
    block = {reinterpret_cast<unsigned char*>(shared.data()), shared_bytes, 0, blocks, threads};
    machine.entry = entry;
    machine.parameters = parameters;
    machine.random = seed * 0x9E3779B97F4A7C15u + 1;
    machine.words.resize(shared_bytes / 4 + 1);
    machine.error = error;
    machine.error_bytes = error_bytes;
    error[0] = 0;
    for (; block.index < blocks && error[0] == 0; ++block.index)
        for (std::uint32_t first = 0; first < threads && error[0] == 0; first += WARP) {
            begin_warp(first);
            run_warp();
            warp_ended();
        }
}

// Returns whether nothing failed; else `error` says what did.
extern "C" bool ptx_launch(void (*entry)(const unsigned char* const*), const unsigned char* const* parameters,
                           std::uint32_t blocks, std::uint32_t threads, std::size_t shared_bytes, std::uint64_t seed,
                           char* error, std::size_t error_bytes) {
    run_grid(entry, parameters, blocks, threads, shared_bytes, seed, error, error_bytes, [] {});
    return error[0] == 0;
}

}  // namespace ptx
