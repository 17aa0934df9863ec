#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>

#include "base/execution.h"
#include "base/timer.h"

namespace tessera {

/// A progress bar on standard error: one line, redrawn a few times a second. Draws nothing unless standard
/// error is a terminal.
class ProgressBar : public ProgressSink {
  public:
    explicit ProgressBar(bool enabled);
    ~ProgressBar() override;
    void update(std::string_view stage, std::int64_t done, std::int64_t total) override;
    /// Wipes the line; call before printing anything else.
    void clear();

  private:
    bool enabled_;
    std::mutex mutex_;
    std::atomic<std::int64_t> nextDrawMs_{0};
    Timer clock_;
    bool drawn_ = false;
};

}  // namespace tessera
