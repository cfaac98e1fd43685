#include "core/poll.h"

namespace wive {
namespace {

constexpr auto period = std::chrono::milliseconds(100);

thread_local Poll* current = nullptr;

}  // namespace

Poll::Poll(Check check) : check_(check), outer_(current) { current = this; }
Poll::~Poll() { current = outer_; }

void Poll::poll() {
    if (!check_) return;
    const auto now = std::chrono::steady_clock::now();
    if (!begun_) {
        begun_ = true;
        next_ = now + period;
    }
    if (now < next_) return;
    next_ = now + period;
    check_();
}

void poll_caller() {
    if (current) current->poll();
}

}  // namespace wive
