#pragma once

#include <chrono>

namespace tessera {

/// Wall clock since construction or the last restart, in milliseconds.
class Timer {
  public:
    Timer() : start_(std::chrono::steady_clock::now()) {}
    double elapsedMs() const {
        return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
    }
    double restart() {
        const double ms = elapsedMs();
        start_ = std::chrono::steady_clock::now();
        return ms;
    }

  private:
    std::chrono::steady_clock::time_point start_;
};

/// Largest resident set of this process so far, in bytes (0 where the system doesn't tell).
long long peakMemoryBytes();
/// What it holds now.
long long residentMemoryBytes();

}  // namespace tessera
