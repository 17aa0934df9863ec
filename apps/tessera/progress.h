#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include "base/run_progress.h"
#include "base/timer.h"

namespace tessera {

/// How far a run is, as one line on standard error: what it is at, which step of how many, the share of the
/// whole, and the time left. Redrawn ten times a second at most, by a thread of its own, so also while the
/// work reports nothing. Draws nothing unless standard error is a terminal.
class ProgressLine {
  public:
    explicit ProgressLine(bool wanted);
    ~ProgressLine();
    ProgressLine(const ProgressLine&) = delete;
    ProgressLine& operator=(const ProgressLine&) = delete;

    /// What work reports to; null when nothing is drawn.
    ProgressSink* sink() { return enabled_ ? &run_ : nullptr; }

  private:
    void drawAgain();
    void draw();

    bool enabled_;
    Timer clock_;
    RunProgress run_;
    std::mutex stopMutex_;
    std::condition_variable stopped_;
    bool stop_ = false;
    std::thread drawer_;
};

/// Wipes the line where one is drawn, and keeps it away for as long as the result lives: to be held by
/// whatever prints.
std::unique_lock<std::mutex> pauseProgress();

/// The line's text, at most width - 1 columns.
std::string progressText(const ProgressState& state, std::size_t width);

}  // namespace tessera
