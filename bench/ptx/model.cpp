// Counts what the warps of a GPU would do: each thread's blocks and accesses are recorded while it runs as a fiber,
// then the threads of a warp are replayed in step, and their accesses go through a model of an L1 cache.
#include <bit>
#include <list>
#include <unordered_map>

namespace ptx {
namespace {

// What a thread did: a block of instructions, or, if that is negative, an access.
struct Event {
    std::int32_t block;
    bool local = false, writes = false;
    std::uint32_t bytes = 0;
    std::uint64_t address = 0;  // in local memory, the place on the thread's stack
};
std::array<std::vector<Event>, WARP> events;

// The program's blocks: how many instructions, of which function, and where paths meet again.
struct Blocks {
    const std::uint32_t* length;
    const std::int32_t* function;
    const std::int32_t* meeting;
};

// What 32 lanes ask for at once: the sectors of 32 bytes, or a warp's words of local memory.
struct Request {
    bool local, writes;
    std::vector<std::uint64_t> parts;
};

struct Counts {
    std::uint64_t instructions, lane_instructions, lines, sectors, missed_sectors, local_lines, local_missed_sectors;
};

// One warp, its lanes replayed.
class Replay {
public:
    Replay(const Blocks& blocks, Counts& counts) : blocks_(blocks), counts_(counts) {}

    std::vector<Request> run() {
        std::uint32_t all = 0;
        for (unsigned lane = 0; lane < WARP; ++lane)
            if (!events[lane].empty()) all |= 1u << lane;
        std::vector<std::int32_t> stops;
        if (all != 0) run_together(all, stops, blocks_.function[next(std::countr_zero(all))]);
        return std::move(requests_);
    }

private:
    bool at_block(unsigned lane) const { return at_[lane] < events[lane].size() && events[lane][at_[lane]].block >= 0; }
    std::int32_t next(unsigned lane) const { return events[lane][at_[lane]].block; }

    template <class Function>
    static void each(std::uint32_t mask, Function function) {
        for (; mask != 0; mask &= mask - 1) function(static_cast<unsigned>(std::countr_zero(mask)));
    }

    // Takes the accesses that lanes make in the block they are in, the n-th of each lane at once.
    void take_requests(std::uint32_t mask) {
        for (;;) {
            Request request{};
            std::vector<std::uint64_t>& parts = request.parts;
            bool any = false;
            each(mask, [&](unsigned lane) {
                if (at_[lane] >= events[lane].size() || at_block(lane)) return;
                const Event& event = events[lane][at_[lane]++];
                any = true;
                request.local = event.local;
                request.writes = event.writes;
                // A warp's local memory is interleaved: the same word of all lanes is one line.
                const unsigned unit = request.local ? 4 : 32;
                const std::uint64_t last = event.address + event.bytes - 1;
                for (std::uint64_t part = event.address / unit; part <= last / unit; ++part) parts.push_back(part);
            });
            if (!any) return;
            std::ranges::sort(parts);
            parts.erase(std::unique(parts.begin(), parts.end()), parts.end());
            std::size_t lines = 0;
            for (std::size_t i = 0; i < parts.size(); ++i)
                lines += request.local || i == 0 || parts[i] / 4 != parts[i - 1] / 4;
            if (request.local) {
                counts_.local_lines += lines;
            } else if (!request.writes) {
                counts_.lines += lines;
            }
            requests_.push_back(std::move(request));
        }
    }

    // Runs lanes from their next block on until each stands at one of `stops` or has left the function.
    void run_together(std::uint32_t mask, std::vector<std::int32_t>& stops, std::int32_t function) {
        const auto stands = [&](std::int32_t block) { return std::ranges::find(stops, block) != stops.end(); };
        while (mask != 0) {
            const std::int32_t block = next(std::countr_zero(mask));
            each(mask, [&](unsigned lane) { ++at_[lane]; });
            counts_.instructions += blocks_.length[block];
            counts_.lane_instructions += std::uint64_t{blocks_.length[block]} * std::popcount(mask);
            take_requests(mask);
            run_calls(mask, function);
            std::vector<std::pair<std::int32_t, std::uint32_t>> paths;
            each(mask, [&](unsigned lane) {
                if (!at_block(lane) || blocks_.function[next(lane)] != function || stands(next(lane))) return;
                auto path = std::ranges::find(paths, next(lane), [](const auto& one) { return one.first; });
                if (path == paths.end()) path = paths.insert(path, {next(lane), 0u});
                path->second |= 1u << lane;
            });
            if (paths.size() <= 1) {
                mask = paths.empty() ? 0 : paths[0].second;
                continue;
            }
            const std::int32_t meeting = blocks_.meeting[block];
            std::ranges::sort(paths);
            std::uint32_t arrived = 0, all = 0;
            stops.push_back(meeting);
            for (const auto& [first, lanes] : paths) {
                all |= lanes;
                if (first != meeting) run_together(lanes, stops, function);
            }
            stops.pop_back();
            each(all, [&](unsigned lane) {
                if (at_block(lane) && next(lane) == meeting) arrived |= 1u << lane;
            });
            if (stands(meeting)) return;
            mask = arrived;
        }
    }

    // Runs the functions that a block calls: functions stand before those that call them.
    void run_calls(std::uint32_t mask, std::int32_t function) {
        for (;;) {
            std::int32_t callee = function;
            std::uint32_t calling = 0;
            each(mask, [&](unsigned lane) {
                if (!at_block(lane) || blocks_.function[next(lane)] >= function) return;
                if (calling == 0) callee = blocks_.function[next(lane)];
                if (blocks_.function[next(lane)] == callee) calling |= 1u << lane;
            });
            if (calling == 0) return;
            std::vector<std::int32_t> stops;
            run_together(calling, stops, callee);
            take_requests(calling);
        }
    }

    const Blocks& blocks_;
    Counts& counts_;
    std::array<std::size_t, WARP> at_{};
    std::vector<Request> requests_;
};

// The sectors of the lines used last; one touch says whether the sector was there.
class Cache {
public:
    explicit Cache(std::size_t lines) : most_(lines) {}

    bool touch(std::uint64_t sector) {
        const std::uint64_t line = sector / 4;
        const unsigned bit = 1u << sector % 4;
        if (const auto found = places_.find(line); found != places_.end()) {
            order_.splice(order_.begin(), order_, found->second);
            const bool hit = (found->second->second & bit) != 0;
            found->second->second |= bit;
            return hit;
        }
        order_.emplace_front(line, bit);
        places_[line] = order_.begin();
        if (places_.size() > most_) {
            places_.erase(order_.back().first);
            order_.pop_back();
        }
        return false;
    }

private:
    std::size_t most_;
    std::list<std::pair<std::uint64_t, unsigned>> order_;
    std::unordered_map<std::uint64_t, std::list<std::pair<std::uint64_t, unsigned>>::iterator> places_;
};

// The warps that an SM holds at once, which take turns, request by request.
class Residents {
public:
    Residents(std::size_t most, std::size_t lines, Counts& counts) : most_(most), cache_(lines), counts_(counts) {}

    void add(std::vector<Request> requests) {
        if (warps_.size() == most_) run_until(most_ - 1);
        warps_.push_back({std::move(requests), 0, number_++});
    }
    void run_until(std::size_t left) {
        while (warps_.size() > left) {
            for (Warp& warp : warps_)
                if (warp.next < warp.requests.size()) access(warp.requests[warp.next++], warp.number);
            std::erase_if(warps_, [](const Warp& warp) { return warp.next == warp.requests.size(); });
        }
    }

private:
    struct Warp {
        std::vector<Request> requests;
        std::size_t next;
        std::uint64_t number;
    };

    void access(const Request& request, std::uint64_t warp) {
        if (!request.local && request.writes) return;
        for (const std::uint64_t part : request.parts) {
            if (!request.local) {
                ++counts_.sectors;
                counts_.missed_sectors += !cache_.touch(part);
                continue;
            }
            const std::uint64_t line = std::uint64_t{1} << 60 | warp << 24 | part;
            for (unsigned sector = 0; sector < 4; ++sector)
                counts_.local_missed_sectors += !cache_.touch(4 * line + sector);
        }
    }

    std::size_t most_;
    Cache cache_;
    Counts& counts_;
    std::vector<Warp> warps_;
    std::uint64_t number_ = 0;
};

}  // namespace

void step(std::int32_t number) { events[machine.running].push_back({number}); }

void access(bool writes, const unsigned char* address, std::uint32_t bytes) {
    if (is_shared(address)) return;
    const auto& stack = machine.stacks[machine.running];
    const bool local = address >= stack.data() && address < stack.data() + stack.size();
    const std::uint64_t place = local ? address - stack.data() : reinterpret_cast<std::uintptr_t>(address);
    events[machine.running].push_back({-1, local, writes, bytes, place});
}

// As ptx_launch, for a program that was translated with its blocks; adds to the counts.
extern "C" bool ptx_model(void (*entry)(const unsigned char* const*), const unsigned char* const* parameters,
                          std::uint32_t blocks, std::uint32_t threads, std::size_t shared_bytes, const Blocks* program,
                          std::size_t resident_warps, std::size_t l1_lines, Counts* counts, char* error,
                          std::size_t error_bytes) {
    Residents residents(resident_warps, l1_lines, *counts);
    const auto replay = [&] {
        residents.add(Replay(*program, *counts).run());
        for (auto& own : events) own.clear();
    };
    for (auto& own : events) own.clear();
    run_grid(entry, parameters, blocks, threads, shared_bytes, 1, error, error_bytes, replay);
    residents.run_until(0);
    return error[0] == 0;
}

}  // namespace ptx
