#include "progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace tessera {

namespace {
constexpr int kBarWidth = 30;
constexpr std::int64_t kRedrawMs = 100;
}  // namespace

ProgressBar::ProgressBar(bool enabled) : enabled_(enabled && isatty(STDERR_FILENO) == 1) {}

ProgressBar::~ProgressBar() {
    clear();
}

void ProgressBar::update(std::string_view stage, std::int64_t done, std::int64_t total) {
    if (!enabled_ || total <= 0) return;
    // Workers call this for every item: all but one in a tenth of a second leave without taking the lock.
    const std::int64_t now = std::int64_t(clock_.elapsedMs());
    std::int64_t next = nextDrawMs_.load(std::memory_order_relaxed);
    if (now < next || !nextDrawMs_.compare_exchange_strong(next, now + kRedrawMs)) return;
    std::lock_guard lock(mutex_);
    const double share = std::clamp(double(done) / double(total), 0.0, 1.0);
    const int filled = int(share * kBarWidth);
    const std::string line = fmt::format("\r{:<10} [{:#<{}}{:.<{}}] {:3.0f} %", stage, "", filled, "",
                                         kBarWidth - filled, share * 100);
    std::fputs(line.c_str(), stderr);
    std::fflush(stderr);
    drawn_ = true;
}

void ProgressBar::clear() {
    std::lock_guard lock(mutex_);
    if (!drawn_) return;
    std::fputs("\r\x1b[K", stderr);
    std::fflush(stderr);
    drawn_ = false;
}

}  // namespace tessera
